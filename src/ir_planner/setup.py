"""Plans collision-free movements and whole programs with their joules, seconds and clearance."""

from setuptools import find_packages, setup

PACKAGE = "ir_planner"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy", "scipy", "highspy"],
    extras_require={"ompl": ["ompl"], "contract": ["pytest"]},
    zip_safe=False,
    maintainer="The maintainers",
    maintainer_email="maintainers@example.org",
    description="Plans collision-free movements and programs with their joules, seconds and "
    "clearance",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "ir_planner = ir_planner.node:main",
            "ir_moveit = ir_planner.node.moveit:main",
        ]
    },
)
