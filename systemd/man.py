#!/usr/bin/env python3
"""Makes the manual pages: man.py PROGRAMS OUT, from what the programs in the folder PROGRAMS say to --help, and
roadvecd.toml(5) from what roadvecd says to --print-config. So the pages say what the programs say."""

import gzip
import pathlib
import re
import subprocess
import sys

PAGES = {"roadvecd": 8, "roadvec": 1, "roadvec-replay": 1, "roadvec-inspect": 1, "roadvec-simulate": 1, "roadvec-score": 1,
         "roadvec-import": 1}
ENTRY = re.compile(r"^  (\S.*?)(?: {2,}(\S.*))?$")  # "  --option VALUE      what it does"
HEADING = re.compile(r"^([A-Z][A-Z ]*[A-Z])$")


def plain(text):
    """Text as roff wants it: no line of it is a request, no hyphen a typographic one."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\n".join("\\&" + line if line[:1] in (".", "'") else line for line in text.split("\n"))


def verbatim(lines):
    text = "\n".join(lines).strip("\n")
    return [".nf", plain(text), ".fi"] if text else []


def prose(lines):
    """Paragraphs; one in which a line is indented is a table and stays as it is."""
    page = []
    for paragraph in "\n".join(lines).strip("\n").split("\n\n"):
        table = any(line.startswith(" ") for line in paragraph.split("\n"))
        page += [".PP"] + (verbatim(paragraph.split("\n")) if table else [plain(paragraph)])
    return page


def entries(lines):
    """Options or arguments, each with its meaning, which may go on in further lines."""
    page = []
    for line in lines:
        entry = ENTRY.match(line)
        if entry:
            page += [".TP", f"\\fB{plain(entry[1])}\\fR"] + ([plain(entry[2])] if entry[2] else [])
        elif line.strip():
            page.append(plain(line.strip()))
    return page


def help_parts(*command):
    """The text before the usage line, the usage, the lists under their titles, the text after them."""
    text = subprocess.run([*command, "--help"], capture_output=True, text=True, check=True).stdout
    before, usage, rest = re.match(r"(.*?)^Usage: (.*?)\n(.*)", text, re.S | re.M).groups()
    lists, after = {}, rest.lstrip("\n").split("\n")
    while after and re.match(r"^(Positionals|Options|Subcommands):$", after[0]):
        title, end = after[0], 1
        while end < len(after) and (not after[end].strip() or after[end].startswith("  ")) and after[end:end + 2] != ["", ""]:
            end += 1
        lists[title[:-1]] = after[1:end]
        after = "\n".join(after[end:]).lstrip("\n").split("\n")
    return before.strip().split("\n"), usage, lists, after


def sections(lines):
    page, body = [], []
    for line in [*lines, ""]:
        if HEADING.match(line):
            page += prose(body) if any(body) else []
            page.append(f".SH {line}")
            body = []
        else:
            body.append(line)
    return page + (prose(body) if any(body) else [])


def start(name, section, version, summary):
    return [f'.TH {name.upper()} {section} "" "{version}" "roadvec"', ".SH NAME", f"{plain(name)} \\- {plain(summary)}"]


def see_also(name):
    others = [f"\\fB{plain(page)}\\fR({section})" for page, section in [*PAGES.items(), ("roadvecd.toml", 5)] if page != name]
    return [".SH SEE ALSO", ", ".join(others)]


def commands_of(program, lists, after, *path):
    """The commands of a program, and theirs. What is said after each of them as after the program is said once."""
    page = []
    for entry in filter(None, map(ENTRY.match, lists.get("Subcommands", []))):
        command = (*path, entry[1])
        about, usage, command_lists, command_after = help_parts(program, *command)
        page += [f".SS {plain(usage)}"] + prose(about)
        for title in [title for title in command_lists if title != "Subcommands"]:
            page += entries(line for line in command_lists[title] if "-h,--help" not in line)
        page += prose(command_after) if command_after != after and any(command_after) else []
        page += commands_of(program, command_lists, command_after, *command)
    return page


def program_page(program, version):
    name = program.name
    about, usage, lists, after = help_parts(program)
    summary = re.sub(rf"^{name}(:| -) ", "", about[0]).rstrip(".")
    page = start(name, PAGES[name], version, summary) + [".SH SYNOPSIS", plain(usage)]
    page += ([".SH DESCRIPTION"] + prose(about[1:])) if any(about[1:]) else []
    page += [".SH ARGUMENTS"] + entries(lists["Positionals"]) if "Positionals" in lists else []
    page += [".SH OPTIONS"] + entries(lists["Options"])
    page += [".SH COMMANDS"] if "Subcommands" in lists else []
    page += commands_of(program, lists, after)
    return page + sections(after)


def configuration_page(program, version):
    text = subprocess.run([program, "--print-config"], capture_output=True, text=True, check=True).stdout
    page, meaning = start("roadvecd.toml", 5, version, "configuration of roadvecd") + [".SH DESCRIPTION"], []
    for line in text.split("\n"):
        table = re.match(r"^(\[\w+\])(?:  # (.*))?$", line)
        if line.startswith("#"):
            meaning.append(line[1:].strip())
        elif table:
            page += prose(meaning) if meaning else []
            page += [f".SH {table[1]}"] + ([plain(table[2])] if table[2] else [])
            meaning = []
        elif line:
            page += [".TP", f"\\fB{plain(line)}\\fR"] + [plain(part) for part in meaning]
            meaning = []
        elif meaning:
            page += prose(meaning)
            meaning = []
    return page + [".SH FILES", "/etc/roadvec/roadvecd.toml"]


def main(programs, out):
    version = subprocess.run([programs / "roadvecd", "--version"], capture_output=True, text=True, check=True).stdout.strip()
    pages = {(name, section): program_page(programs / name, version) for name, section in PAGES.items()}
    pages["roadvecd.toml", 5] = configuration_page(programs / "roadvecd", version)
    for (name, section), page in pages.items():
        folder = out / f"man{section}"
        folder.mkdir(parents=True, exist_ok=True)
        text = "\n".join(page + ([] if ".SH SEE ALSO" in page else see_also(name))) + "\n"
        # No time stamp: the same programs give the same bytes.
        (folder / f"{name}.{section}.gz").write_bytes(gzip.compress(text.encode(), mtime=0))


if __name__ == "__main__":
    main(*map(pathlib.Path, sys.argv[1:]))
