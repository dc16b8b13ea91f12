"""Recorder of the cell: MCAP writer and node, playback, offline analysis and the HTML report."""

from setuptools import find_packages, setup

PACKAGE = "ir_recorder"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "report/assets/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=[
        "setuptools",
        "numpy",
        "scipy",
        "PyYAML",
        "mcap",
        "mcap-ros2-support",
        "zstandard",
        "lz4",
    ],
    extras_require={"picture": ["matplotlib"], "parquet": ["pyarrow"]},
    zip_safe=False,
    maintainer="The maintainers",
    maintainer_email="maintainers@example.org",
    description="Recorder node, playback, offline analysis and HTML report of a robot cell's "
    "MCAP files",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "ir_recorder = ir_recorder.node:main",
            "ir-record = ir_recorder.node:main",
            "ir-play = ir_recorder.play.node:main",
            "ir-report = ir_recorder.report_main:main",
        ],
    },
)
