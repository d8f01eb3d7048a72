#!/usr/bin/env python3
"""Makes man pages and the completion for bash from what `mapmend --help` and the help of its commands say.

    commands.py MAPMEND FOLDER

FOLDER/man gets a page for mapmend and one for each command (commands of commands are sections of it), gzipped;
FOLDER/mapmend is the completion.
"""

import concurrent.futures
import gzip
import pathlib
import re
import subprocess
import sys

# The words of an option or positional: "-h,--help", "--out FOLDER [x]", "INPUT ...".
ENTRY = re.compile(r"^  (\S.*?)(?:\s{2,}(\S.*))?$")
SECTION = re.compile(r"^(Positionals|Options|Subcommands):$")


class Command:
    """name: "mapmend edges list". entries: of each section, (head, text)."""

    def __init__(self, name, text):
        self.name, self.about, self.usage, self.notes = name, "", "", []
        self.entries = {"Positionals": [], "Options": [], "Subcommands": []}
        self.subcommands = []
        self.read(text)

    def read(self, text):
        about, rest = re.split(r"^Usage: ", text, maxsplit=1, flags=re.M)
        self.about = " ".join(about.split())
        self.usage, _, rest = rest.partition("\n")
        section, notes = None, []
        for line in rest.split("\n"):
            if found := SECTION.match(line):
                section = found[1]
            elif section and line.startswith(" " * 20) and self.entries[section]:
                self.entries[section][-1][1].append(line.strip())
            elif section and (entry := ENTRY.match(line)):
                self.entries[section].append((entry[1], [entry[2]] if entry[2] else []))
            elif line.strip():
                section = None
                notes.append(line.strip())
        self.notes = notes

    def options(self):
        """The long names."""
        return re.findall(r"--[\w-]+", " ".join(head.split(" ")[0] for head, _ in self.entries["Options"]))

    def word(self):
        return self.name.rsplit(" ", 1)[-1]


def ask(mapmend, words):
    done = subprocess.run([mapmend, *words, "--help"], capture_output=True, text=True, check=False)
    if done.returncode != 0 or "Usage: " not in done.stdout:
        # A program that is not part of this build, e.g. the simulator.
        if "is missing" in done.stderr:
            return None
        sys.exit(f"commands.py: mapmend {' '.join(words)} --help fails: {done.stderr}")
    return Command(" ".join(["mapmend", *words]), done.stdout)


def walk(mapmend, words=(), said=()):
    """A command with all below it. said: the notes of all that it belongs to, which its help may repeat."""
    command = ask(mapmend, words)
    if command:
        if command.notes in said:
            command.notes = []
        names = [head.split(" ")[0] for head, _ in command.entries["Subcommands"]]
        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            found = list(pool.map(lambda name: walk(mapmend, (*words, name), [*said, command.notes]), names))
        command.subcommands = [sub for sub in found if sub]
    return command


def roff(text):
    """Text as troff takes it as it stands."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text.startswith((".", "'")) else text


def body(command, heading=".SH"):
    """Everything of a page behind its name."""
    lines = [heading + " SYNOPSIS", ".B " + roff(command.name), roff(command.usage.removeprefix(command.name).strip()),
             heading + " DESCRIPTION", roff(command.about + "." if not command.about.endswith(".") else command.about)]
    for section in ("Positionals", "Options", "Subcommands"):
        if command.entries[section]:
            lines += [heading + " " + {"Positionals": "ARGUMENTS", "Subcommands": "COMMANDS"}.get(section, "OPTIONS")]
        for head, text in command.entries[section]:
            word, _, kind = head.partition(" ")
            lines += [".TP", f"\\fB{roff(word)}\\fR {roff(kind)}".rstrip(), roff(" ".join(text)) or "\\&"]
    if command.notes:
        lines += [heading + " NOTES", *(roff(note) for note in command.notes)]
    return lines


def page(command, version):
    title = command.name.replace(" ", "-")
    lines = [f'.TH {title.upper()} 1 "" "{version}" "mapmend"', ".SH NAME",
             f"{roff(title)} \\- {roff(command.about[:1].lower() + command.about[1:].rstrip('.'))}", *body(command)]
    nested = command.subcommands if " " in command.name else []
    for sub in nested:
        lines += [f".SH {roff(sub.name.upper())}", *body(sub, ".SS")]
    others = ["mapmend"] if nested or " " in command.name else [sub.name.replace(" ", "-") for sub in command.subcommands]
    lines += [".SH SEE ALSO", ",\n".join(f"\\fB{roff(other)}\\fR(1)" for other in others)]
    return "\n".join(lines) + "\n"


COMPLETION = r"""# bash completion for mapmend; made from its help by packaging/commands.py
_mapmend() {
  local current=${COMP_WORDS[COMP_CWORD]} command="" word i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    word=${COMP_WORDS[i]}
    [[ $word == -* ]] && break
    case " $(_mapmend_commands "$command") " in
      *" $word "*) command+="${command:+ }$word" ;;
      *) break ;;
    esac
  done
  local commands words=""
  commands=$(_mapmend_commands "$command")
  if [[ $current == -* ]]; then
    words=$(_mapmend_options "$command")
  elif ((i == COMP_CWORD)); then
    words=$commands
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  # Files, where neither an option nor a command stands.
  if [[ $current != -* && -z $commands ]]; then
    compopt -o filenames 2>/dev/null
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
  fi
}
_mapmend_commands() {
  case "$1" in
@COMMANDS@
  esac
}
_mapmend_options() {
  case "$1" in
@OPTIONS@
  esac
}
complete -F _mapmend mapmend
"""


def completion(command):
    commands, options = [], []

    def add(of, path):
        if of.subcommands:
            commands.append(f"    '{path}') echo {' '.join(sub.word() for sub in of.subcommands)} ;;")
        options.append(f"    '{path}') echo {' '.join(sorted(set(of.options())))} ;;")
        for sub in of.subcommands:
            add(sub, f"{path} {sub.word()}".strip())

    add(command, "")
    return COMPLETION.replace("@COMMANDS@", "\n".join(commands)).replace("@OPTIONS@", "\n".join(options))


def main():
    mapmend, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    version = subprocess.run([mapmend, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    command = walk(mapmend)
    (folder / "man").mkdir(parents=True, exist_ok=True)
    for written in [command, *command.subcommands]:
        packed = gzip.compress(page(written, version).encode(), 9, mtime=0)
        (folder / "man" / (written.name.replace(" ", "-") + ".1.gz")).write_bytes(packed)
    (folder / "mapmend").write_text(completion(command))


if __name__ == "__main__":
    main()
