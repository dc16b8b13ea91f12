"""Simulated KUKA KR210 on a KR C4: trajectories, power modes, PLC bits and the mains meter."""

from setuptools import find_packages, setup

PACKAGE = "ir_sim_driver"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy", "scipy", "PyYAML", "pybullet"],
    zip_safe=False,
    maintainer="The maintainers",
    maintainer_email="maintainers@example.org",
    description="Simulated KUKA KR210 on a KR C4 with power modes, PLC bits and a mains meter",
    license="Apache-2.0",
    entry_points={"console_scripts": ["ir_sim_driver = ir_sim_driver.node:main"]},
)
