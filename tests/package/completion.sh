# completion.sh PROGRAM COMPLETION MANUAL: goes through the commands by their help, under bash.
set -eu
bench=$1
. "$2"
# What Tab offers after the words.
offered() {
  COMP_WORDS=(ferrobench "$@")
  COMP_CWORD=$#
  COMPREPLY=()
  _ferrobench
  printf '%s\n' "${COMPREPLY[@]}"
}
# The names of the commands that a help lists.
commands() { sed -n '/^Subcommands:/,/^$/s/^  \([a-z]*\) .*/\1/p'; }
count=0
check() {  # check COMMAND...
  local help option sub
  help=$("$bench" "$@" --help)
  for option in $(printf '%s\n' "$help" | sed -n '/^Options:/,/^[A-Z]/s/^  \(-[a-z],\)\{0,1\}\(--[a-z-]*\).*/\2/p'); do
    offered "$@" "$option" | grep -qx -- "$option" || { echo "$* $option is not completed"; exit 1; }
    grep -q -- "$option" "$manual" || { echo "$* $option is not in the manual"; exit 1; }
    count=$((count + 1))
  done
  for sub in $(printf '%s\n' "$help" | commands); do
    offered "$@" "$sub" | grep -qx "$sub" || { echo "$* $sub is not completed"; exit 1; }
    grep -q "^.SS ferrobench${*:+ $*} $sub\b" "$manual" || { echo "$* $sub is not in the manual"; exit 1; }
    check "$@" "$sub"
  done
}
manual=$3
check
[ "$count" -gt 60 ] || { echo "only $count options were found"; exit 1; }
[ "$(offered table 3.1 | wc -l)" = 4 ]
[ "$(offered report x.h5 --format h)" = html ]
offered run full | grep -qx full-loops
offered run x --model soft | grep -qx soft-pzt
[ -z "$(offered --data r)" ]  # a folder, which bash completes
