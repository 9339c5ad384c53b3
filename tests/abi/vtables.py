# SPDX-License-Identifier: Apache-2.0
"""Reads virtual tables, and sizes of classes, out of x86-64 ELF libraries with binutils.

A slot is told by the function behind it, as "name(arguments) const" without its class: that is what must agree between
a class of ours and the runtime's own. Return types are not part of it.
"""

import re
import subprocess

PURE = "__cxa_pure_virtual"


def _run(*command, text=None):
    return subprocess.run(command, input=text, capture_output=True, text=True, check=True).stdout


def mangle(namespace, *names):
    """The Itanium name of a nested class, without prefix: N<len>namespace<len>name...E."""
    return "N" + "".join(f"{len(name)}{name}" for name in (namespace, *names)) + "E"


class Library:
    """One ELF library: its symbols (also the local ones, where they are kept) and dynamic relocations."""

    def __init__(self, path, namespace):
        self.path = str(path)
        self.namespace = namespace
        self._addresses, self._sizes, self._names = {}, {}, {}
        for flags in ("-S", "-DS"):
            self._read_symbols(_run("nm", flags, self.path))
        self._relocations = self._read_relocations(_run("readelf", "-rW", self.path))
        self._sections = self._read_sections(_run("readelf", "-SW", self.path))

    def _read_symbols(self, listing):
        for line in listing.splitlines():
            fields = line.split()
            if len(fields) == 4:
                name = fields[3].split("@")[0]
                address = int(fields[0], 16)
                self._addresses[name] = address
                self._sizes[name] = int(fields[1], 16)
                self._names.setdefault(address, set()).add(name)

    @staticmethod
    def _read_relocations(listing):
        found = {}
        for line in listing.splitlines():
            fields = line.split()
            if len(fields) >= 4 and fields[2] == "R_X86_64_RELATIVE":
                found[int(fields[0], 16)] = ("address", int(fields[3], 16))
            elif len(fields) >= 5 and fields[2] == "R_X86_64_64":
                found[int(fields[0], 16)] = ("name", fields[4].split("@")[0])
        return found

    @staticmethod
    def _read_sections(listing):
        """Address, offset in the file and size of each section that the file has bytes of."""
        found = re.findall(r"PROGBITS\s+([0-9a-f]+) ([0-9a-f]+) ([0-9a-f]+)", listing)
        return [tuple(int(word, 16) for word in row) for row in found]

    def slots(self, *class_names):
        """The slots of a class's virtual table, first destructor first, each a set of candidate names (linkers
        fold)."""
        symbol = "_ZTV" + mangle(self.namespace, *class_names)
        return self.slots_of_symbol(symbol)

    def slots_of_symbol(self, symbol):
        if symbol not in self._addresses:
            raise LookupError(f"{self.path} has no virtual table {symbol}")
        start = self._addresses[symbol]
        words = [self._word(start + 8 * i) for i in range(2, self._sizes[symbol] // 8)]
        return [{strip_class(name, self.namespace) for name in names} for names in self._demangle(words)]

    def _word(self, offset):
        kind, value = self._relocations.get(offset, ("name", PURE))
        if kind == "name":
            return [value]
        return sorted(self._names.get(value, {f"local function at {value:#x}"}))

    @staticmethod
    def _demangle(words):
        flat = [name for names in words for name in names]
        plain = iter(_run("c++filt", text="\n".join(flat)).split("\n"))
        return [[next(plain) for _ in names] for names in words]

    def value_types(self):
        """Size of the record by which VtValue tells a type, and the type's number in it, by the type's mangled name."""
        start, end = f"_ZZN{len(self.namespace)}{self.namespace}7VtValue5_InitI", "E12_GetTypeInfoEvE2ti"
        names = [name for name in self._addresses if name.startswith(start) and name.endswith(end)]
        return {name[len(start) : -len(end)]: (self._sizes[name], self._number(name)) for name in names}

    def _number(self, name):
        """The int after the two references at the record's beginning."""
        at = self._addresses[name] + 16
        for first, offset, size in self._sections:
            if first <= at < first + size:
                with open(self.path, "rb") as file:
                    file.seek(offset + at - first)
                    return int.from_bytes(file.read(4), "little", signed=True)
        raise LookupError(f"{self.path} keeps no bytes of {name}")

    def size_by_destructor(self, class_name):
        """Bytes that the deleting destructor gives back; None where there is none with a size."""
        symbol = "_ZN" + mangle(self.namespace, class_name)[1:-1] + "D0Ev"
        if symbol not in self._addresses:
            return None
        start = self._addresses[symbol]
        listing = _run(
            "objdump", "-d", "--no-show-raw-insn", f"--start-address={start:#x}",
            f"--stop-address={start + self._sizes[symbol]:#x}", self.path,
        )
        sizes = re.findall(r"mov\s+\$0x([0-9a-f]+),%esi", listing)
        return int(sizes[-1], 16) if sizes else None


def strip_class(name, namespace):
    """"ns::A<B>::f(ns::C const&) const" becomes "f(C const&) const"; a destructor of any class becomes "~"."""
    name = name.replace(namespace + "::", "").replace("(anonymous namespace)::", "")
    head = _end_of_name(name)
    qualifier = _last_scope(name[:head])
    own = name[qualifier:head]
    return "~" if own.startswith("~") else own + name[head:]


def _end_of_name(name):
    depth = 0
    for i, letter in enumerate(name):
        depth += (letter == "<") - (letter == ">")
        if letter == "(" and depth == 0:
            return i
    return len(name)


def _last_scope(name):
    depth, start = 0, 0
    for i, letter in enumerate(name):
        depth += (letter == "<") - (letter == ">")
        if depth == 0 and name[i : i + 2] == "::":
            start = i + 2
    return start


def differences(ours, theirs):
    """Lines that say where two lists of slots differ; empty when they agree slot by slot."""
    found = []
    if len(ours) != len(theirs):
        found.append(f"{len(ours)} slots, the runtime has {len(theirs)}")
    for i, (mine, its) in enumerate(zip(ours, theirs)):
        if PURE in its:
            continue
        if not mine & its:
            found.append(f"slot {i}: {' or '.join(sorted(mine))}, the runtime has {' or '.join(sorted(its))}")
    return found
