"""The `ir` command: the demonstration, service calls, cells and reports."""

from setuptools import find_packages, setup

PACKAGE = "ir_cli"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy", "PyYAML"],
    zip_safe=False,
    maintainer="The maintainers",
    maintainer_email="maintainers@example.org",
    description="The ir command: demonstration without launch files, service calls, cells and "
    "reports",
    license="Apache-2.0",
    entry_points={"console_scripts": ["ir = ir_cli.main:main"]},
)
