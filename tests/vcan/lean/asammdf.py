"""Found before the package of this name by the Python programs on vcan.

python-can imports asammdf for MF4 files if there is one, and with it pandas and pyarrow. In User-Mode Linux that takes
each program 2 s.
"""

raise ImportError("left out on vcan, where nothing reads MF4 files")
