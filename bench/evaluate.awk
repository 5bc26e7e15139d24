# awk -f evaluate.awk -v name=NAME TRUTH.csv OBS.csv [TRUTH.csv OBS.csv ...]: the errors of what `lapservo track` wrote
# against what `lapservo render` drew, as one row of docs/notes/accuracy.md. A video's rows go by the frame's number.
BEGIN { FS = ","; pi = atan2(0, -1) }
function wrapped(x) { x = x - 2 * pi * int(x / (2 * pi)); return x > pi ? x - 2 * pi : x < -pi ? x + 2 * pi : x }
function square(x) { return x * x }
function rms(sum, n) { return n ? sqrt(sum / n) : 0 }
FNR == 1 {
  delete column
  for (i = 1; i <= NF; ++i) column[$i] = i
  is_truth = !("status" in column)
  if (is_truth) { delete truth; delete number; frames = 0; read_truth = 1 }
  next
}
function value(what) { return $(column[what]) }
is_truth {
  file = value("file")
  if (!(file in number)) number[file] = frames++
  key = number[file] SUBSEP value("instrument")
  for (what in column) truth[key, what] = value(what)
  ++expected
  next
}
{
  file = value("file")
  sub(/.*\//, "", file)
  key = (file == "" ? value("frame") : number[file]) SUBSEP value("instrument")
  if (value("status") != "ok" || !((key, "file") in truth)) next
  ++found
  beyond += value("p_false") > 0.001 || value("sigma_roll_rad") > 0.03  # docs/statuses.md
  for (k = 0; k < 4; ++k) {
    edge += square(value("e" k "_u_px") - truth[key, "e" k "_u_px"]) + square(value("e" k "_v_px") - truth[key, "e" k "_v_px"])
    ++edges
  }
  if (value("psi_rad") == "") next
  ++n
  error = 1e3 * wrapped(value("psi_rad") - truth[key, "psi_rad"])
  sum += error
  squares += square(error)
  if (error * error > largest * largest) largest = error
  if (error * error > 1e4) ++wrong
  z += square(error / (1e3 * value("sigma_psi_rad")))
  theta += square(1e3 * wrapped(value("theta_rad") - truth[key, "theta_rad"]))
  phi += square(1e3 * wrapped(value("phi_rad") - truth[key, "phi_rad"]))
  rho += square(1e3 * (value("rho_m") - truth[key, "rho_m"]))
}
END {
  if (!expected) { print "evaluate.awk: no truth given" > "/dev/stderr"; exit 2 }
  mean = n ? sum / n : 0
  printf "| %s | %d | %.0f %% | %+.2f | %.2f | %.2f | %.2f | %.2f, %.2f | %.3f | %.3f | %.2f | %d |\n", name, expected,
    100 * found / expected, mean, rms(squares - n * mean * mean, n), rms(squares, n), largest < 0 ? -largest : largest,
    rms(theta, n), rms(phi, n), rms(rho, n), rms(edge, edges), rms(z, n), wrong
  if (beyond) { printf "%s: %d of %d are ok beyond the limits of ok\n", name, beyond, found > "/dev/stderr"; exit 1 }
}
