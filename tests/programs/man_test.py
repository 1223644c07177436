"""The manual pages say what the programs say: every option and command of every --help, and every key of the configuration."""

import gzip
import re
import subprocess
import sys

import programs
from programs import BIN, SOURCE, ProgramTest, run

PROGRAMS = {"roadvecd": 8, "roadvec": 1, "roadvec-replay": 1, "roadvec-inspect": 1, "roadvec-simulate": 1, "roadvec-score": 1,
            "roadvec-import": 1}
OPTION = re.compile(r"(?<![\w/-])--?[A-Za-z][\w-]*")


def helps_of(program, *path):
    """The help of a program, of its commands, and of theirs."""
    text = run(program, *path, "--help").stdout
    yield text
    listed = re.search(r"^Subcommands:\n((?:(?:  .*)?\n)*?)\n\n", text + "\n\n", re.M)
    for command in re.findall(r"^  (\S+)", listed[1], re.M) if listed else []:
        yield from helps_of(program, *path, command)


class ManTest(ProgramTest):
    def setUp(self):
        super().setUp()
        subprocess.run([sys.executable, "-B", SOURCE / "systemd/man.py", BIN, self.folder], check=True)

    def page(self, name):
        """The page as a reader sees it, in lines of any length; roff's complaints are failures."""
        source = gzip.decompress((self.folder / f"man{name[-1]}" / f"{name}.gz").read_bytes())
        shown = subprocess.run(["groff", "-man", "-Tascii", "-ww", "-rLL=1000n", "-P-c", "-P-b", "-P-u", "-P-o"], input=source,
                               capture_output=True, check=True)
        self.assertEqual(shown.stderr, b"", name)
        return shown.stdout.decode()

    def test_every_option_and_command_of_every_help_is_in_its_page(self):
        for program, section in PROGRAMS.items():
            page = self.page(f"{program}.{section}")
            for heading in ("NAME", "SYNOPSIS", "OPTIONS", "EXIT STATUS", "SEE ALSO"):
                self.assertEqual(len(re.findall(f"^{heading}$", page, re.M)), 1, f"{program}: {heading}")
            texts = list(helps_of(program))
            for text in texts:
                usage = re.search(r"^Usage: (.*)$", text, re.M)[1]
                self.assertIn(usage, page)
                for option in OPTION.findall(text):
                    self.assertRegex(page, rf"(?<![\w-]){re.escape(option)}(?![\w-])", f"{usage}")
        self.assertEqual(len(list(helps_of("roadvec"))), 13,
                         "status, metrics, tiles, watch, export and its three formats, control and its two, render, itself")

    def test_every_key_of_the_configuration_is_in_the_page_with_its_meaning(self):
        page = self.page("roadvecd.toml.5")
        text = run("roadvecd", "--print-config").stdout
        lines = [line for line in text.splitlines() if line]
        keys = [line for line in lines if re.match(r"\w+ = ", line)]
        self.assertGreater(len(keys), 100)
        for line in lines:
            for part in line.lstrip("# ").split("  # "):
                self.assertIn(" ".join(part.split()), " ".join(page.split()))

    def test_the_same_programs_give_the_same_pages(self):
        again = self.folder / "again"
        subprocess.run([sys.executable, "-B", SOURCE / "systemd/man.py", BIN, again], check=True)
        for page in self.folder.glob("man*/*"):
            self.assertEqual(page.read_bytes(), (again / page.parent.name / page.name).read_bytes())
        self.assertEqual(len(list(again.glob("man*/*"))), len(PROGRAMS) + 1)


if __name__ == "__main__":
    programs.main()
