"""Print the prefix below which the ROS 2 wheels of this interpreter have put share/, lib/ and
include/.
"""

import importlib.util
import pathlib
import sys


def main() -> str:
    """Return the nearest folder above the interface generator's module that holds an ament
    index.
    """
    spec = importlib.util.find_spec("rosidl_adapter")
    if spec is None or spec.origin is None:
        return "no ROS 2 wheels here: pip install -r requirements/setup.txt comes first"
    for folder in pathlib.Path(spec.origin).parents:
        if (folder / "share" / "ament_index").is_dir():
            print(folder)
            return ""
    return f"no share/ament_index above {spec.origin}"


if __name__ == "__main__":
    sys.exit(main() or 0)
