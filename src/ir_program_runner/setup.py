"""Runs a planned program on the driver: movements, pauses with their power mode, signals of the
machines.
"""

from setuptools import find_packages, setup

PACKAGE = "ir_program_runner"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy"],
    zip_safe=False,
    maintainer="The maintainers",
    maintainer_email="maintainers@example.org",
    description="Runs a planned program: movements, pauses with their power mode, signals of the "
    "machines",
    license="Apache-2.0",
    entry_points={"console_scripts": ["ir_program_runner = ir_program_runner.node:main"]},
)
