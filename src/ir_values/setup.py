"""Values: arrays, settings, YAML with lines, files, and the errors of the house."""

from setuptools import find_packages, setup

PACKAGE = "ir_values"

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
    maintainer="The ir maintainers",
    maintainer_email="maintainers@example.org",
    description="Values: arrays, settings, YAML with lines, files, and the errors of the house",
    license="Apache-2.0",
    python_requires=">=3.11",
)
