"""Installs launch file, parameters, views and the security policy below share/ir_bringup."""

from glob import glob

from setuptools import setup

PACKAGE = "ir_bringup"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=[PACKAGE],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        *(
            (f"share/{PACKAGE}/{folder}", sorted(glob(f"{folder}/*")))
            for folder in ("launch", "config", "rviz", "foxglove", "security")
        ),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="The maintainers",
    maintainer_email="maintainers@example.org",
    description="Launch file, parameters, RViz configuration and Foxglove layout of the cell",
    license="Apache-2.0",
)
