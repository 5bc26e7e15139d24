"""The page of the Python module: what `help()` has of each public name, in the module's own order of kinds."""

import enum
import importlib
import inspect
import re

#: pybind11 begins a docstring with its signatures, "1. name(...)" where there are several.
SIGNATURE = re.compile(r"^(?:\d+\. )?(\w+\(.*\)(?: -> .*)?)$")
NOISE = re.compile(r"^(Overloaded function\.|\w+\(\*args, \*\*kwargs\)|Initialize self\. .*)$")


def plain(text):
    """Names as users write them."""
    text = re.sub(r"\blapservo\.(_\w+\.)?(?=[A-Z])", "", text)
    text = re.sub(r"\bself(: \w+)?(, |(?=\)))", "", text)
    text = re.sub(r"(: |-> )'([^']*)'(?=[,)]| = |$)", r"\1\2", text)  # annotations that were not evaluated
    return re.sub(r"numpy\.ndarray\[numpy\.(\w+)(\[[^\]]*\])?\]", r"ndarray[\1]", text)


def described(doc, signature=None):
    """A docstring as Markdown: its signatures as code, the rest as text."""
    lines = [line for line in inspect.cleandoc(doc or "").splitlines() if not NOISE.match(line)]
    signatures = [plain(found[1]) for line in lines if (found := SIGNATURE.match(line))]
    if signature:
        signatures.insert(0, plain(signature))
    text = "\n".join(line for line in lines if not SIGNATURE.match(line)).strip()
    code = "```python\n" + "\n".join(signatures) + "\n```\n" if signatures else ""
    return f"{code}\n{text}\n" if text else code


def of_function(name, function):
    signature = f"{name}{inspect.signature(function)}" if inspect.isfunction(function) else None
    return described(function.__doc__, signature)


def members_of(cls):
    """Its own, in the order of the class."""
    for name, value in vars(cls).items():
        value = value.__func__ if isinstance(value, (staticmethod, classmethod)) else value
        if name == "__init__" and inspect.isroutine(value):
            yield cls.__name__, of_function(cls.__name__, value).replace("__init__(", f"{cls.__name__}(")
        elif not name.startswith("_") and callable(value) and not inspect.isclass(value):
            yield name, of_function(name, value)


def of_class(cls):
    parts = [described(cls.__doc__)]
    if issubclass(cls, enum.Enum):
        return "\n".join([*parts, *(f"- `{member.name}`: `{member.value!r}`" for member in cls)]) + "\n"
    parts += [text for _, text in sorted(members_of(cls), key=lambda member: member[0] != cls.__name__)]
    rows = [f"| `{name}` | {' '.join(plain(inspect.getdoc(value) or '').split()).replace('|', 'or')} |"
            for name, value in vars(cls).items() if isinstance(value, property) and not name.startswith("_")]
    if rows:
        parts.append("\n".join(["| attribute | |", "| --- | --- |", *rows]) + "\n")
    return "\n".join(parts)


def page():
    module = importlib.import_module("lapservo")
    public = {name: getattr(module, name) for name in module.__all__}
    sections = [("Functions", {name: value for name, value in public.items() if not inspect.isclass(value)}),
                ("Classes", {name: value for name, value in public.items() if inspect.isclass(value)})]
    text = inspect.getdoc(module) + "\n"
    for title, names in sections:
        text += f"\n## {title}\n"
        for name, value in names.items():
            text += f"\n### {name}\n\n" + (of_class(value) if inspect.isclass(value) else of_function(name, value))
    return text
