"""Reading a pickle without running anything in it.

A pickle is a program that may call any function of any module. Here it is written in nothing but
the opcodes that this takes, and finds nothing but the names that it is given.
"""

from __future__ import annotations

import pickle
import pickletools
from collections.abc import Callable, Mapping
from typing import IO, Any

Names = Mapping[str, Any]
"""What stands for the classes and functions that a pickle asks for, by their full names."""


def unpickle(file: IO[bytes], names: Names, saved: Callable[[Any], Any] | None = None) -> Any:
    """Read the pickle that begins where the file stands.

    Args:
        names: What stands for what the pickle asks for, by its full name.
        saved: Finds what lies outside the pickle, by what it is called there.
    Raises: pickle.UnpicklingError naming what it asks for beyond what dumps need; any other
        exception where opcodes do not fit each other, or the file ends among them.
    """
    stack: list[Any] = []
    marks: list[int] = []
    memo: dict[int, Any] = {}
    argument: Any

    def pop_to_mark() -> list[Any]:
        start = marks.pop()
        items = stack[start:]
        del stack[start:]
        return items

    for opcode, argument, _ in pickletools.genops(file):
        match opcode.name:
            case "PROTO" | "FRAME":
                pass
            case "STOP":
                return stack.pop()
            case "MARK":
                marks.append(len(stack))
            case name if name in CONSTANTS:
                stack.append(CONSTANTS[name])
            case name if name in LITERALS:
                stack.append(argument)
            case "EMPTY_LIST":
                stack.append([])
            case "EMPTY_DICT":
                stack.append({})
            case "LIST":
                stack.append(pop_to_mark())
            case "DICT":
                stack.append(_fill({}, pop_to_mark()))
            case "TUPLE":
                stack.append(tuple(pop_to_mark()))
            case "TUPLE1" | "TUPLE2" | "TUPLE3" as name:
                count = int(name[-1])
                stack[-count:] = [tuple(stack[-count:])]
            case "APPEND":
                item = stack.pop()
                _extend(stack[-1], [item])
            case "APPENDS":
                items = pop_to_mark()
                _extend(stack[-1], items)
            case "SETITEM":
                value, key = stack.pop(), stack.pop()
                _fill(stack[-1], [key, value])
            case "SETITEMS":
                items = pop_to_mark()
                _fill(stack[-1], items)
            case "MEMOIZE":
                memo[len(memo)] = stack[-1]
            case "PUT" | "BINPUT" | "LONG_BINPUT":
                memo[argument] = stack[-1]
            case "GET" | "BINGET" | "LONG_BINGET":
                stack.append(memo[argument])
            case "GLOBAL":
                stack.append(_find(names, *argument.split(" ", 1)))
            case "STACK_GLOBAL":
                name, module = stack.pop(), stack.pop()
                stack.append(_find(names, module, name))
            case "REDUCE" | "NEWOBJ":
                arguments, called = stack.pop(), stack.pop()
                stack.append(_call(names, called, arguments))
            case "BUILD":
                state = stack.pop()
                _set_state(stack[-1], state)
            case "BINPERSID" if saved is not None:
                stack.append(saved(stack.pop()))
            case other:
                raise pickle.UnpicklingError(f"the opcode {other}")
    raise EOFError


CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_TUPLE": ()}
# fmt: off
LITERALS = frozenset([
    "INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "FLOAT", "BINFLOAT",
    "UNICODE", "SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8",
    "SHORT_BINBYTES", "BINBYTES", "BINBYTES8", "BYTEARRAY8",
])
# fmt: on
"""Opcodes whose argument is the value; texts of Python 2 are not among them."""


def _extend(target: object, items: list[Any]) -> None:
    if type(target) is not list:
        raise pickle.UnpicklingError(f"items for a {type(target).__name__}")
    target.extend(items)


def _fill(target: object, items: list[Any]) -> object:
    """Fill a dict. Its keys are names: to hash tuples of tuples may take for ever, or crash."""
    keys = items[::2]
    if type(target) is not dict or not all(type(key) is str for key in keys):
        raise pickle.UnpicklingError("a dict whose keys are no names")
    target.update(zip(keys, items[1::2], strict=True))
    return target


def _find(names: Names, module: object, name: object) -> Any:
    # protocols 0 to 2 keep to what modules were called in Python 2
    modules = {"__builtin__": "builtins", "copy_reg": "copyreg"}
    if not isinstance(module, str) or not isinstance(name, str):
        raise pickle.UnpicklingError("a name that is no text")
    full_name = f"{modules.get(module, module)}.{name}"
    if full_name not in names:
        raise pickle.UnpicklingError(f"it asks for {full_name}")
    return names[full_name]


def _call(names: Names, called: Any, arguments: object) -> Any:
    if not any(called is known for known in names.values()) or not isinstance(arguments, tuple):
        raise pickle.UnpicklingError(f"a call of a {type(called).__name__}")
    return called(*arguments)


def _set_state(target: Any, state: Any) -> None:
    # none but what stands for something has it: nothing else of a class was made
    if not hasattr(target, "__setstate__"):
        raise pickle.UnpicklingError(f"state for a {type(target).__name__}")
    target.__setstate__(state)
