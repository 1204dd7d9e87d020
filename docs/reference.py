"""The reference pages of the site: commands, channels and requirements from the program, keys from the tables that
tests compare with the code, the Python package from its source."""

import ast
import os
import re
import subprocess

# Documents with tables of keys, and what their keys are in.
KEYS = {
    "scenarios/README.md": "a scenario",
    "docs/structures.md": "`[structure]` of a scenario",
    "docs/own-protocol.md": "`[wire]` of a scenario",
    "docs/canopen.md": "`[[wire.drives]]` of a scenario with CANopen",
}


def write(root, folder, program):
    """Writes all pages."""
    folder.mkdir(parents=True)
    (folder / "commands.md").write_text(commands(program))
    (folder / "python.md").write_text(python_package(root))
    (folder / "keys.md").write_text(keys(root))
    subprocess.run([program, "reference", folder], check=True, stdout=subprocess.DEVNULL)


def keys(root):
    """Every table of keys, those of a scenario by section."""
    parts = ["# All keys\n\nKeys of scenarios, from the tables of the documents that explain them.\n"]
    for name, inside in KEYS.items():
        title, tables = tables_of_keys((root / name).read_text())
        parts.append(f"## Of {inside}\n\nExplained in [{title}](../../{name}); “see below” is there.\n")
        for table in tables:
            parts += by_section(table) if "." in table[2].split("|")[1] else ["\n".join(table) + "\n"]
    return "\n".join(parts)


def tables_of_keys(text):
    """The title of a document, and its tables whose first column is `key`, as lists of lines."""
    title = re.search(r"^# (.*)$", text, re.MULTILINE)[1]
    tables = re.findall(r"^\| key \|.*\n(?:\|.*\n)+", text, re.MULTILINE)
    # Their links are from where they stand.
    return title, [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", table).splitlines() for table in tables]


def by_section(table):
    """A table in parts, one for each word before the first dot of the keys."""
    head, sections = table[:2], {}
    for row in table[2:]:
        sections.setdefault(row.split("`")[1].split(".")[0], []).append(row)
    return [f"### {name}\n\n" + "\n".join([*head, *rows]) + "\n" for name, rows in sections.items()]


def help_of(program, *words):
    environment = os.environ | {"COLUMNS": "80"}
    done = subprocess.run([program, *words, "--help"], capture_output=True, text=True, check=True, env=environment)
    return done.stdout


def listed(text):
    """The names in the lists of commands of a help."""
    before = text.split("\nCommon to all commands:")[0].split("Usage:")[1]
    lines = [line for line in before.splitlines()[1:] if line.startswith("  ") and not line.startswith("   ")]
    return [line.split()[0] for line in lines if line.split()[0] != "help"]


def commands(program):
    """The help of every command."""
    parts = ["# Commands\n\nAs `--help` prints them.\n"]

    def add(*words):
        text = help_of(program, *words)
        parts.append(f"## resonarm {' '.join(words)}".rstrip() + f"\n\n```text\n{text.rstrip()}\n```\n")
        # `<COMMAND>...` is the command line of another program.
        for name in listed(text) if not words or re.search(r"^Usage: .* <COMMAND>$", text, re.MULTILINE) else []:
            add(*words, name)

    add()
    return "\n".join(parts)


def python_package(root):
    """What the Python package exports, with signatures and documentation strings."""
    folder = root / "python/resonarm"
    exported = [name for name in literal(folder / "__init__.py", "__all__") if not name.startswith("_")]
    definitions = {}
    for path in [*sorted(folder.glob("*.py")), folder / "_resonarm.pyi"]:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                definitions.setdefault(node.name, node)
    parts = ["# The Python package\n\nWhat `import resonarm` offers; [its guide](../python.md) shows how it is used.\n"]
    for name in exported:
        if name in definitions:
            parts += described(definitions[name], "##", "resonarm")
    return "\n".join(parts)


def literal(path, name):
    """The value of a list of strings at the top of a module."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == name:
            return ast.literal_eval(node.value)
    raise SystemExit(f"{path} has no {name}")


def described(node, level, owner):
    """A class with its public methods, or a function."""
    signature = ""
    if isinstance(node, ast.FunctionDef):
        returns = f" → {ast.unparse(node.returns)}" if node.returns else ""
        signature = f"({ast.unparse(node.args)}){returns}"
    text = ast.get_docstring(node) or ""
    parts = [f"{level} {owner}.{node.name}\n"]
    parts += [f"```text\n{node.name}{signature}\n```\n"] if signature else []
    parts += [text.replace("<", "&lt;") + "\n"] if text else []
    if isinstance(node, ast.ClassDef):
        for inner in node.body:
            if isinstance(inner, ast.FunctionDef) and not inner.name.startswith("_") and ast.get_docstring(inner):
                parts += described(inner, level + "#", node.name)
    return parts
