"""Many plans of a cell, and what follows: planners compared, where things should stand."""

from setuptools import find_packages, setup

PACKAGE = "ir_studies"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "*.html", "*/*.html", "*/*.css"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy", "scipy", "PyYAML"],
    zip_safe=False,
    maintainer="The maintainers",
    maintainer_email="maintainers@example.org",
    description="Many plans of a cell, and what follows: planners compared, where things should "
    "stand",
    license="Apache-2.0",
    extras_require={"cluster": ["dask", "distributed"]},
    entry_points={"console_scripts": ["ir_studies = ir_studies.node:main"]},
)
