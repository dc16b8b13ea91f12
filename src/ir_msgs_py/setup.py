"""The shared vocabulary in Python: value types, names, conversions, a client for scripts, test
fixtures.
"""

from setuptools import find_packages, setup

PACKAGE = "ir_msgs_py"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "ros/*.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numpy", "scipy", "PyYAML"],
    entry_points={"pytest11": [f"{PACKAGE} = {PACKAGE}.ros.testing"]},
    zip_safe=False,
    maintainer="The maintainers",
    maintainer_email="maintainers@example.org",
    description="Shared vocabulary in Python: value types, names, conversions, client for "
    "scripts, fixtures",
    license="Apache-2.0",
)
