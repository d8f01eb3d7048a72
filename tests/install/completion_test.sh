#!/usr/bin/env bash
# Does the completion for bash name every command, the commands of commands, their options, and files?
#   completion_test.sh MAPMEND COMPLETION
set -euo pipefail
mapmend=$1
source "$2"
cd "$(mktemp -d)"
touch flight.mp4

# What is offered for the last of some words, on one line.
offered() {
  COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
  _mapmend
  echo " ${COMPREPLY[*]} "
}
fail() { echo "completion: $*" >&2; exit 1; }
holds() { [[ $1 == *" $2 "* ]] || fail "$2 is not offered, but$1"; }

commands=$("$mapmend" --help | sed -n '/^Subcommands:/,/^$/ s/^  \([a-z]*\) .*/\1/p')
number=$(wc -w <<<"$commands")
[ "$number" -ge 15 ] || fail "the help of mapmend names $number commands only"
for command in $commands; do
  [ "$command" = simulate ] && ! "$mapmend" simulate --help >/dev/null 2>&1 && continue  # not part of this build
  holds "$(offered mapmend "")" "$command"
done
[ "$(offered mapmend rec)" = " recover " ] || fail "'rec' gives$(offered mapmend rec)"
holds "$(offered mapmend edges "")" disable
holds "$(offered mapmend db rep)" repair
holds "$(offered mapmend run --cam)" --camera
holds "$(offered mapmend edges list --js)" --json
holds "$(offered mapmend run --camera x.yaml fl)" flight.mp4
[[ $(offered mapmend edges "") != *flight.mp4* ]] || fail "a file where a command belongs"
echo "completion: $number commands"
