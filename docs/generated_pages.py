"""Pages that are written from the package and the repository when the site is built, so that no page can
differ from the code: keys of a scene, observables, commands, and copies of READMEs and notebooks."""

import hashlib
import json
import os
import re
import shutil
from pathlib import Path

from esail_jax import observables
from esail_jax.cli import parser
from esail_jax.observables.entry import in_words
from esail_jax.scenes.key_reference import describe_keys
from esail_jax.scenes.loading import builtin_names, builtin_text
from esail_jax.scenes.toml_text import commented

ROOT = Path(__file__).parents[1]
PAGES = Path(__file__).parent / "generated"

FILES = ("VALIDATION.md", "CONTRIBUTING.md", "CHANGELOG.md", "LICENSE", "CITATION.cff")
"""Files of the repository that have a place on the site."""

PICTURES = (".png", ".webp", ".gif", ".svg")


def write() -> None:
    """Writes all generated pages to `docs/generated`, which is made anew."""
    shutil.rmtree(PAGES, ignore_errors=True)
    PAGES.mkdir()
    (PAGES / "keys.md").write_text(keys_page(), encoding="utf-8")
    (PAGES / "observables.md").write_text(observables_page(), encoding="utf-8")
    (PAGES / "commands.md").write_text(commands_page(), encoding="utf-8")
    (PAGES / "scenes.md").write_text(scenes_page(), encoding="utf-8")
    for name in FILES:
        copy_page(ROOT / name)
    for page in sorted((ROOT / "experiments").rglob("*.md")):
        copy_page(page)
    with (PAGES / "experiments" / "README.md").open("a", encoding="utf-8") as page:
        page.write(experiments_contents())
    copy_notebooks()


# ---- pages from the package ----------------------------------------------------------------------


def keys_page() -> str:
    """The reference of all keys of a scene."""
    lines = [
        "# Keys of a scene",
        "",
        "A scene is a TOML file of tables. A table that is absent leaves out its part of the model. "
        "`esail init` writes a scene with a comment on every key. Numbers of tethers and rods are one "
        "number for all, or a list with one number for each.",
    ]
    table = None
    for key in describe_keys():
        heading = f"## `[{key.table}]` of a {' or a '.join(key.models)}"
        if heading != table:
            lines += ["", heading, "", *header("key", "unit", "type", "default", "rule", "meaning")]
            table = heading
        default = "required" if key.required else "absent" if key.default is None else toml(key.default)
        lines.append(row(f"`{key.name}`", key.unit, key.type, default, key.rule, key.doc))
    return "\n".join(lines) + "\n"


def observables_page() -> str:
    """The reference of all observables."""
    lists = {
        "a sail": observables.sail.OBSERVABLES,
        "a sail, on request (`save=`)": observables.sail.ON_REQUEST,
        "a chain of rods": (*observables.chain.OBSERVABLES, observables.chain.ENERGY_ERROR),
    }
    lines = [
        "# Observables",
        "",
        "An observable is a signal that a run reports at every saved instant. Its first axis is `time`. "
        '"Derived" means that the printed formula is wrong and the derived one is used '
        "([errata](experiments/paper_errata/ERRATA.md)). The suffixes `_I`, `_O` and `_B` name the axes in "
        "which a vector is given ([frames](../theory.md)). X_B is the axis of the hub about which the sail "
        "spins, Z_O points away from the Sun.",
    ]
    lines += [
        "",
        "After the release of a tether (`[[event]]`), the observables of the whole sail still include that "
        "tether: thrust and its moments, coning and lagging angles, energies and the smallest distance of "
        "tethers are computed as if it still belonged to the sail. Only the plane of the tips (frame E) "
        "leaves it out.",
    ]
    for title, entries in lists.items():
        lines += ["", f"## Observables of {title}", ""]
        lines += header("name, symbol", "unit", "axes after time", "meaning, equation")
        for entry in entries:
            needs = f" Only with {in_words(entry.needs)}." if entry.needs else ""
            lines.append(
                row(
                    f"`{entry.name}`<br>`{entry.symbol}`",
                    entry.unit,
                    ", ".join(entry.axes) or "-",
                    f"{entry.meaning}{needs}<br>{entry.equation}",
                )
            )
    return "\n".join(lines) + "\n"


def commands_page() -> str:
    """The help of all commands."""
    top = parser()
    os.environ["COLUMNS"] = "100"
    commands = next(action for action in top._actions if action.dest == "command").choices
    lines = ["# Commands", "", "```text", top.format_help().rstrip(), "```"]
    for name, command in commands.items():
        lines += ["", f"## `esail {name}`", "", "```text", command.format_help().rstrip(), "```"]
    return "\n".join(lines) + "\n"


def scenes_page() -> str:
    """The text of all built-in scenes, as `esail init` writes them."""
    lines = [
        "# Built-in scenes",
        "",
        "`esail scenes` lists these scenes, `esail init NAME` writes one of them.",
    ]
    for name in builtin_names():
        lines += ["", f"## `{name}`", "", "```toml", commented(builtin_text(name)).rstrip(), "```"]
    return "\n".join(lines) + "\n"


def experiments_contents() -> str:
    """What the page of experiments needs on the site beside its own text: their place in the menu,
    and the pages that are tables."""
    pages = sorted((PAGES / "experiments").glob("*/README.md"))
    names = [page.parent.name for page in pages]
    lines = ["", "```{toctree}", ":hidden:", "", *[f"{name}/README" for name in names], "```"]
    others = sorted(set((PAGES / "experiments").glob("*/*.md")) - set(pages))
    others = [page.relative_to(PAGES / "experiments").with_suffix("") for page in others]
    lines += ["", "```{toctree}", ":maxdepth: 1", ":caption: Tables", "", *map(str, others), "```"]
    return "\n".join(lines) + "\n"


def copy_notebooks() -> None:
    """Copies the notebooks twice: to `downloads` as they are, and to `notebooks` as pages, with a link to
    the first copy."""
    (PAGES / "notebooks").mkdir()
    (PAGES / "downloads").mkdir()
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        shutil.copyfile(path, PAGES / "downloads" / path.name)
        notebook = json.loads(path.read_text(encoding="utf-8"))
        notebook["cells"][0]["source"] += [
            f"\n\n{{download}}`Download this notebook <../downloads/{path.name}>` ",
            "([how to open it](../../course.md#open-a-notebook)).",
        ]
        (PAGES / "notebooks" / path.name).write_text(json.dumps(notebook), encoding="utf-8")


def kept_outputs() -> Path:
    """The folder in which outputs of notebooks are kept. Its name is a checksum of the package,
    because outputs of another version are of no use."""
    package = ROOT / "esail_jax"
    checksum = hashlib.sha256()
    for path in sorted((*package.rglob("*.py"), *package.rglob("*.toml"))):
        checksum.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return ROOT / "build" / "notebooks" / checksum.hexdigest()[:16]


# ---- copies of pages -----------------------------------------------------------------------------


def copy_page(path: Path) -> None:
    """Copies a file of the repository with the pictures it shows. A link to a file that has no place on the
    site becomes the name of that file."""
    target = PAGES / path.relative_to(ROOT)
    target.parent.mkdir(parents=True, exist_ok=True)
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        text = re.sub(
            r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)", lambda link: linked(path, link), text
        )
    target.write_text(text, encoding="utf-8")


def linked(page: Path, link: re.Match) -> str:
    """What a link of a page is on the site."""
    picture, text, address = link.groups()
    if "://" in address or address.startswith("#"):
        return link.group()
    goal = (page.parent / address.partition("#")[0]).resolve()
    inside = goal.relative_to(ROOT) if goal.is_relative_to(ROOT) else None
    if goal.is_dir() and (goal / "README.md").exists():
        return f"[{text}]({address.rstrip('/')}/README.md)"
    if goal.suffix in (*PICTURES, ".csv", ".toml") and goal.exists() and inside.parts[0] == "experiments":
        copy = PAGES / inside
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(goal, copy)
        return link.group()
    if inside is not None and (
        str(inside) in FILES or (goal.suffix == ".md" and inside.parts[0] == "experiments")
    ):
        return link.group()
    return text if picture or text.startswith("`") else f"{text} (`{inside or goal.name}`)"


# ---- tables --------------------------------------------------------------------------------------


def header(*names: str) -> list[str]:
    """The first two lines of a Markdown table."""
    return [row(*names), "|" + "---|" * len(names)]


def row(*cells: str) -> str:
    """A line of a Markdown table."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def toml(value: object) -> str:
    """A default as a TOML file has it."""
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f'`"{value}"`' if isinstance(value, str) else f"`{value}`"
