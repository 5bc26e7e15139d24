"""stubs.py TYPES OUT: the types of lapservo's extension with the docstrings and defaults that it has, as OUT.

TYPES has neither, and `name: type` for a class's read-only property; the package is that of PYTHONPATH, whose bindings
begin each docstring with the signature.
"""

import ast
import re
import sys

import numpy as np

import lapservo


def parts_of(doc, names):
    """Signature and text of the binding, of an overloaded one that with arguments of these names."""
    sections = re.split(r"^\d+\. ", doc, flags=re.MULTILINE)[1:] if "Overloaded function." in doc else [doc]
    for section in sections:
        signature, _, text = section.partition("\n")
        if all(f"{name}: " in signature for name in names):
            return signature, text.strip()
    sys.exit(f"no signature with {names} in {doc!r}")


def default_of(signature, name):
    found = re.search(rf"\b{name}: [^=]*? = (.*?)(?=, \w+: |, \*, |\) ->)", signature)
    value = eval(found[1], {"array": np.array})
    return ast.parse(repr(value.tolist() if isinstance(value, np.ndarray) else value), mode="eval").body


def complete(function, doc):
    arguments = function.args
    names = [each.arg for each in arguments.args + arguments.kwonlyargs if each.arg != "self"]
    signature, text = parts_of(doc, names)
    positional = arguments.args[len(arguments.args) - len(arguments.defaults):]
    arguments.defaults = [default_of(signature, each.arg) for each in positional]
    arguments.kw_defaults = [default and default_of(signature, each.arg)
                             for each, default in zip(arguments.kwonlyargs, arguments.kw_defaults)]
    return text


def property_of(attribute):
    text = f"@property\ndef {attribute.target.id}(self) -> {ast.unparse(attribute.annotation)}: ..."
    return ast.parse(text).body[0]


def document(node, thing):
    if isinstance(node, ast.ClassDef):
        for each in node.body:
            if isinstance(each, (ast.FunctionDef, ast.ClassDef)):
                document(each, vars(thing).get(each.name))
        text = thing.__doc__ or ""
    elif isinstance(node, ast.FunctionDef):
        thing = getattr(thing, "__func__", thing)  # of a static method
        bound = thing is not None and not isinstance(thing, property) and re.match(rf"{node.name}\(", thing.__doc__ or "")
        text = complete(node, thing.__doc__) if bound else getattr(thing, "__doc__", None) or ""
    if text.strip():
        node.body.insert(0, ast.Expr(ast.Constant(text.strip())))


tree = ast.parse(open(sys.argv[1]).read())
for each in tree.body:
    if isinstance(each, ast.ClassDef):
        each.body = [property_of(one) if isinstance(one, ast.AnnAssign) else one for one in each.body]
    if isinstance(each, (ast.FunctionDef, ast.ClassDef)) and hasattr(lapservo, each.name):  # a build may lack ROS 2
        document(each, getattr(lapservo, each.name))
with open(sys.argv[2], "w") as out:
    out.write(ast.unparse(ast.fix_missing_locations(tree)) + "\n")
