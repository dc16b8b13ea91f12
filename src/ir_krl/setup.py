"""KUKA Robot Language: programs read, run as a controller would drive them, and written."""

from setuptools import find_packages, setup

PACKAGE = "ir_krl"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "language/krl.lark"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy", "lark-parser"],
    zip_safe=False,
    maintainer="The maintainers",
    maintainer_email="maintainers@example.org",
    description="KUKA Robot Language: programs read, run as a controller would drive them, and "
    "written",
    license="Apache-2.0",
)
