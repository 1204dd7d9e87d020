"""Puts a virtual environment under an embedded interpreter, which does not see it by itself."""

import site
import sys


def activate(directory: str, isolated: bool) -> None:
    """Adds the site-packages in `directory` (and its .pth files) before the interpreter's.

    With `isolated` the interpreter's are left out, as in an environment of `python3 -m venv` by default.
    """
    if directory in sys.path:
        return
    own = {*site.getsitepackages(), site.getusersitepackages()}
    before = list(sys.path)
    site.addsitedir(directory)
    added = [entry for entry in sys.path if entry not in before]
    kept = [entry for entry in before if entry not in own]
    sys.path[:] = kept + added + ([] if isolated else [entry for entry in before if entry in own])
