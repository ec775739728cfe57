#!/usr/bin/env python3
"""The reference of the package gimnet as one page of HTML, from its sources: nothing is imported. A public class,
function or attribute without a docstring is a warning, which fails.

    make_reference.py PACKAGE_FOLDER OUTPUT_FOLDER"""

import ast
import html
import pathlib
import sys

STYLE = "body{font:15px/1.5 sans-serif;max-width:56em;margin:2em auto}pre{white-space:pre-wrap}h3{margin-bottom:0}" \
        "code,pre{font-family:monospace}dl{margin-left:1.5em}"


def public_names(tree):
    """Those of __all__; it is a list of texts."""
    for statement in tree.body:
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == "__all__":
            return ast.literal_eval(statement.value)
    raise SystemExit("the package has no __all__")


class Reference:
    def __init__(self, folder):
        trees = {path.stem: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.py"))}
        self.introduction = ast.get_docstring(trees["__init__"])
        self.made = {statement.name: statement for tree in trees.values() for statement in tree.body
                     if isinstance(statement, (ast.ClassDef, ast.FunctionDef))}
        self.names = public_names(trees["__init__"])
        self.warnings = []

    def bases(self, made):
        """The classes of the package that a class is made from, the nearest first."""
        found = []
        for base in made.bases:
            name = base.value if isinstance(base, ast.Subscript) else base
            name = ast.unparse(name).split(".")[-1]
            if name in self.made:
                found += [self.made[name], *self.bases(self.made[name])]
        return found

    def members(self, made):
        """(name, signature, docstring) of what a class has itself or from its bases."""
        seen = {}
        for owner in (made, *self.bases(made)):
            for place, statement in enumerate(owner.body):
                name, signature, text = "", "", None
                if isinstance(statement, ast.FunctionDef):
                    name, text = statement.name, ast.get_docstring(statement)
                    signature = self.signature(statement, is_method=True)
                elif isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
                    name, signature = statement.target.id, f"{statement.target.id}: {ast.unparse(statement.annotation)}"
                    after = owner.body[place + 1] if place + 1 < len(owner.body) else None
                    told = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
                    text = str(after.value.value) if told else ""  # the class tells of its fields
                if not name or name.startswith("_"):
                    continue
                if name not in seen or seen[name][1] is None:
                    seen[name] = (seen[name][0] if name in seen else signature, text)
        return [(name, *found) for name, found in seen.items()]

    @staticmethod
    def signature(function, is_method=False):
        if any(ast.unparse(one) == "property" for one in function.decorator_list):
            return f"{function.name}: {ast.unparse(function.returns)}"
        arguments = ast.unparse(function.args)
        if is_method:
            arguments = arguments.partition(", ")[2] if ", " in arguments else ""
        return f"{function.name}({arguments}) -> {ast.unparse(function.returns)}"

    def text(self, where, text):
        if text is None:
            self.warnings.append(f"{where} has no docstring")
        return f"<pre>{html.escape(text or '')}</pre>"

    def section(self, name):
        made = self.made.get(name)
        if made is None:
            self.warnings.append(f"{name} is in __all__, and is no class or function of the package")
            return ""
        if isinstance(made, ast.FunctionDef):
            return f"<h3 id={name}><code>{html.escape(self.signature(made))}</code></h3>{self.text(name, ast.get_docstring(made))}"
        bases = ", ".join(ast.unparse(base) for base in made.bases)
        parts = [f"<h3 id={name}><code>class {html.escape(f'{name}({bases})' if bases else name)}</code></h3>",
                 self.text(name, ast.get_docstring(made)), "<dl>"]
        if all(base.name != "GimnetError" for base in self.bases(made)):  # exceptions have what that has
            for member, signature, text in self.members(made):
                parts.append(f"<dt><code>{html.escape(signature)}</code><dd>{self.text(f'{name}.{member}', text)}")
        return "".join([*parts, "</dl>"])

    def page(self):
        links = " · ".join(f"<a href=#{name}>{name}</a>" for name in self.names)
        return (f"<!doctype html><meta charset=utf-8><title>gimnet</title><style>{STYLE}</style><h1>gimnet</h1>"
                f"{self.text('the package', self.introduction)}<p>{links}</p>" + "".join(map(self.section, self.names)))


def main():
    reference = Reference(pathlib.Path(sys.argv[1]))
    output = pathlib.Path(sys.argv[2])
    output.mkdir(parents=True, exist_ok=True)
    (output / "index.html").write_text(reference.page(), encoding="utf-8")
    for warning in reference.warnings:
        print(f"make_reference: {warning}", file=sys.stderr)
    sys.exit(1 if reference.warnings else 0)


if __name__ == "__main__":
    main()
