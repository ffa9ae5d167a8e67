"""Checks the pilot's page: its types with TypeScript's compiler, against the messages of the
server, and its code with a linter: `python -m tests.support.page_types`. Skipped, in one line,
where there is no npx.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import msgspec
from msgspec import inspect

from services.cockpit.core import Personal
from services.cockpit.page_messages import PageAbsence, PageSeen, PageSticks, PageWish
from services.cockpit.page_view import PageLine, PageView

PAGE = Path("services/cockpit/page").resolve()
TYPESCRIPT, LINTER = "typescript@5.9.3", "oxlint@1.94.0"
STRUCTS = (PageView, Personal, PageSticks, PageWish, PageAbsence, PageSeen)
# One text to a page, as services/cockpit/core.py puts it together.
TEXT = """
interface PageText {
  n: number; t: number; ages: { state: [number, number]; picture: [number, number] };
  you: Personal; view: PageView;
  log?: PageLine[];
  track?: number[];
}
type PageSaid = PageSticks | PageWish | PageAbsence | PageSeen;
"""
PLAIN: dict[type[inspect.Type], str] = {
    inspect.NoneType: "null", inspect.IntType: "number", inspect.FloatType: "number",
    inspect.BoolType: "boolean", inspect.StrType: "string",
}  # fmt: skip
OPTIONS = {
    "allowJs": True, "checkJs": True, "noEmit": True, "target": "es2023", "module": "es2022",
    "lib": ["es2023", "dom", "dom.iterable"], "moduleResolution": "bundler", "types": [],
    "strict": False, "noImplicitReturns": False, "allowUnreachableCode": False,
    "noFallthroughCasesInSwitch": True, "strictBindCallApply": True, "noImplicitThis": True,
}  # fmt: skip


def typescript(kind: inspect.Type) -> str:
    """The type of one field."""
    match kind:
        case inspect.UnionType(types):
            return " | ".join(typescript(each) for each in types)
        case _ if type(kind) in PLAIN:
            return PLAIN[type(kind)]
        case inspect.LiteralType(values):
            return " | ".join(msgspec.json.encode(value).decode() for value in values)
        case inspect.DictType(_, value):
            return f"Record<string, {typescript(value)}>"
        case inspect.TupleType(items):
            return f"[{', '.join(typescript(each) for each in items)}]"
        case inspect.VarTupleType(item):
            return f"({typescript(item)})[]"
        case inspect.StructType(array_like=True, fields=fields):
            return f"[{', '.join(f'{f.encode_name}: {typescript(f.type)}' for f in fields)}]"
        case inspect.StructType(fields=fields):
            named = (f"{f.encode_name}{_may(f)}: {typescript(f.type)};" for f in fields)
            return f"{{ {' '.join(named)} }}"
        case _:
            raise TypeError(f"a page knows no {kind}")


def _may(field: inspect.Field) -> str:
    """What is as by default is left out of a text."""
    return "" if field.required else "?"


def interface(struct: type[msgspec.Struct]) -> str:
    """What is None is left out of a text; of what a page sends, defaults may be."""
    found: Any = inspect.type_info(struct)
    tag = [] if found.tag_field is None else [f'  {found.tag_field}: "{found.tag}";']
    rows = [
        f"  {field.encode_name}{_may(field)}: {typescript(field.type)};" for field in found.fields
    ]
    return "\n".join([f"interface {struct.__name__} {{", *tag, *rows, "}"])


def protocol() -> str:
    """`protocol.d.ts`: the messages of both directions."""
    line = typescript(inspect.type_info(PageLine))
    return "\n".join([*map(interface, STRUCTS), f"type PageLine = {line};", TEXT])


def main() -> int:
    npx = shutil.which("npx")
    if npx is None:
        print("no npx: types and code of the pilot's page are not checked")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        call = [npx, "--yes", "--package", TYPESCRIPT, "tsc"]
        found = subprocess.run([*call, "--version"], cwd=at, capture_output=True)
        if found.returncode:
            print(f"npx cannot get {TYPESCRIPT}: the types of the pilot's page are not checked")
            return 0
        (at / "protocol.d.ts").write_text(protocol())
        config = {"compilerOptions": OPTIONS, "include": [f"{PAGE}/*.js", "protocol.d.ts"]}
        (at / "tsconfig.json").write_bytes(msgspec.json.encode(config))
        typed = subprocess.run([*call, "--project", "."], cwd=at).returncode
        linted = subprocess.run(
            [npx, "--yes", LINTER, "--deny-warnings", str(PAGE)], cwd=at
        ).returncode
        return typed or linted


if __name__ == "__main__":
    sys.exit(main())
