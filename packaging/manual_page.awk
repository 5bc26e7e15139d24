# awk -v name=lapservo-track -v version='lapservo 0.1.0' -f manual_page.awk: a manual page from a command's --help.
function in_roff(text) {
  gsub(/\\/, "\\e", text)
  gsub(/-/, "\\-", text)
  return text ~ /^[.']/ ? "\\&" text : text
}
function start(title) { print ".SH " title; section = title }
# An option, a positional or a subcommand: what names it, and what it is.
function entry(names, about) {
  gsub(/^ +| +$/, "", names)
  if (section == "SUBCOMMANDS") names = name "-" names "(1)"
  print ".TP\n.B " in_roff(names) "\n" in_roff(about)
}
# Help puts what an entry is behind its names, from column 31, or below where these are longer.
function finish_entry() {
  if (held != "") entry(substr(held, 1, 30), substr(held, 31))
  held = ""
}
NR == 1 {
  about = $0
  sub(/\.$/, "", about)
  print ".TH " toupper(name) " 1 \"\" \"" version "\" \"User Commands\""
  start("NAME")
  print in_roff(name) " \\- " in_roff(tolower(substr(about, 1, 1)) substr(about, 2))
  description = $0
  next
}
/^Usage: / { start("SYNOPSIS"); print ".B " in_roff(substr($0, 8)); start("DESCRIPTION"); print in_roff(description); next }
/^$/ { finish_entry(); next }
/^[A-Za-z]+:$/ { start(toupper(substr($0, 1, length($0) - 1))); verbatim = /^Example/; if (verbatim) print ".nf"; next }
/^[^ ]/ && section != "NOTES" { start("NOTES"); print ".nf"; verbatim = 1 }
verbatim { print in_roff($0); next }
/^                              / { entry(held, substr($0, 31)); held = ""; next }
{ finish_entry(); held = $0 }
END {
  finish_entry()
  if (verbatim) print ".fi"
  if (name == "lapservo") exit
  start("EXIT STATUS")
  print "0 done, 1 found nothing or did not converge, 2 bad input.\n.SH SEE ALSO\n.BR lapservo (1)"
}
