#!/usr/bin/env python3
"""docs/operations.md and docs/tcphub.toml say what `tcphub --help-limits` and `--print-config` say."""

import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]


def documented_limits():
    text = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
    rows = {}
    for line in text[text.index("## Limits"):].splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 5 and cells[1].isdigit():
            rows[cells[0]] = cells[1:]
    return rows


def limits_in_force(tcphub):
    text = subprocess.run([tcphub, "--help-limits"], check=True, capture_output=True, text=True, timeout=20).stdout
    rows = {}
    for match in re.finditer(r"^  (\S+) +(\d+) (\S+) +(.*) \((\d+) to (\d+)\)$", text, re.MULTILINE):
        name, default, unit, reason, least, most = match.groups()
        rows[name] = [default, unit, f"{least} to {most}", reason]
    return rows


def limits_of_the_example(text):
    """As limits_in_force() has them: default, unit, range and reason."""
    rows = {}
    pattern = r"^# (.*) \((\d+ to \d+) (\S+)\)\n#(\w+) = (\d+)$"
    for reason, limits, unit, name, default in re.findall(pattern, text[text.index("\n[limits]"):], re.MULTILINE):
        rows[name] = [default, unit, limits, reason]
    return rows


def fields_in_the_source():
    """What the hub bounds, by the struct that its threads look at."""
    text = (ROOT / "src" / "hub" / "limits.hpp").read_text(encoding="utf-8")
    struct = text[text.index("struct Limits {"):text.index("};")]
    return re.findall(r"^  std::uint64_t (\w+) =", struct, re.MULTILINE)


def printed(tcphub, *arguments):
    return subprocess.run([tcphub, "--print-config", *arguments], check=True, capture_output=True, text=True,
                          timeout=20).stdout


def keys_in(text):
    """Key (with its table) and value of every line KEY = VALUE, commented out or not."""
    keys, table = {}, ""
    for header, key, value in re.findall(r"^\[(\w+)\]$|^#?([a-z0-9_]+) = (.*?)(?:  #.*)?$", text, re.MULTILINE):
        if header:
            table = header + "."
        else:
            keys[table + key] = value
    return keys


class Operations(unittest.TestCase):
    tcphub = ""

    def test_documents_every_limit(self):
        in_force = limits_in_force(self.tcphub)
        self.assertGreater(len(in_force), 20)
        self.assertEqual(documented_limits(), in_force)

    def test_a_limit_that_is_a_setting_is_a_key_everywhere(self):
        settings = list(limits_in_force(self.tcphub))
        self.assertEqual(settings, [name for name in fields_in_the_source() if name in settings], "in their order")
        self.assertEqual(list(documented_limits()), settings)
        limits = [key for key in keys_in(printed(self.tcphub)) if key.startswith("limits.")]
        self.assertEqual(limits, ["limits." + name for name in settings])

    def test_the_flag_reaches_the_others(self):
        others = set(fields_in_the_source()) - set(limits_in_force(self.tcphub))
        self.assertGreater(len(others), 20)
        told = subprocess.run([self.tcphub, "--check-config", *(word for name in sorted(others)
                                                               for word in ("--limit", f"{name}=1000G"))],
                              capture_output=True, text=True, timeout=20, check=False).stderr
        for name in others:
            self.assertRegex(told, rf"limit {name} cannot be '?1000G'?: ")

    def test_documents_what_a_reload_changes(self):
        told = subprocess.run([self.tcphub, "--help-limits"], check=True, capture_output=True, text=True,
                              timeout=20).stdout
        in_force = re.search(r"^A reload changes: (.*)\. The others", told, re.MULTILINE)[1].split(", ")
        text = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
        documented = re.search(r"and of the limits\n\n((?:    .*\n)+)", text)[1]
        self.assertEqual(re.findall(r"\w+", documented), in_force)

    def test_documents_every_key(self):
        text = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
        documented = set(re.findall(r"^\| ([a-z_.]+) \| (?:`--|none)", text, re.MULTILINE))
        self.assertEqual(documented, set(keys_in(printed(self.tcphub).split("[limits]")[0])))

    def test_documents_the_environment_of_programs(self):
        read = set()
        for path in [*(ROOT / "src" / "client").rglob("*.cpp"), *(ROOT / "src" / "tools").rglob("*.cpp"), *(ROOT / "python").rglob("*.py")]:
            read |= set(re.findall(r'"(GIMNET_[A-Z_]+)"', path.read_text(encoding="utf-8")))
        text = (ROOT / "docs" / "operations.md").read_text(encoding="utf-8")
        self.assertEqual(set(re.findall(r"^\| `(GIMNET_[A-Z_]+)` \|", text, re.M)), read)

    def test_the_example_is_the_default_configuration(self):
        example = ROOT / "docs" / "tcphub.toml"
        checked = subprocess.run([self.tcphub, "--check-config", "--config", example], capture_output=True, text=True,
                                 timeout=20, check=False)
        self.assertEqual((checked.returncode, checked.stderr), (0, ""))
        text = example.read_text(encoding="utf-8")
        self.assertLessEqual(set(keys_in(text)), set(keys_in(printed(self.tcphub))))
        self.assertLessEqual(set(keys_in(printed(self.tcphub).split("[limits]")[0])), set(keys_in(text)))
        self.assertEqual(limits_of_the_example(text), limits_in_force(self.tcphub))
        # Whoever takes the comments away gets what there is without the file.
        uncommented = re.sub(r"^#(?=[a-z_]+ = )", "", text, flags=re.MULTILINE)
        with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
            file.write(uncommented)
            file.flush()
            told = printed(self.tcphub, "--config", file.name)
        defaults = printed(self.tcphub)
        for key, value in keys_in(told).items():
            if key not in ("listen", "shards"):  # of the user and of the machine
                self.assertEqual(value, keys_in(defaults)[key], key)


if __name__ == "__main__":
    Operations.tcphub = sys.argv.pop()
    unittest.main()
