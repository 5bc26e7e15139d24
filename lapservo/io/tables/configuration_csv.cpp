#include "lapservo/io/tables/configuration_csv.h"

#include <cmath>
#include <cstddef>
#include <string>

#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#include "lapservo/rig/instruments.h"

namespace lapservo::internal {
std::vector<Configurations> configurations_from(const CsvTable& table, const Rig& rig, const std::string& source) {
  const std::size_t instruments = rig.instruments.size();
  if (table.rows() == 0 || table.rows() % instruments != 0)
    throw InputError(source, "rows", std::to_string(table.rows()),
                     "a row per frame and instrument (" + std::to_string(instruments) + ")");
  std::vector<Configurations> frames(table.rows() / instruments, Configurations(instruments));
  std::vector<std::size_t> named_in(instruments, frames.size());  // the last frame that has it
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::size_t frame = row / instruments;
    const auto found =
        table.has("instrument") ? instrument_index(rig, table.text(row, "instrument")) : row % instruments;
    if (!found) throw InputError(source, "instrument", table.text(row, "instrument"), "an instrument of the rig");
    const std::size_t index = *found;
    if (named_in[index] == frame)
      throw InputError(source, "instrument", rig.instruments[index].name + " twice in frame " + std::to_string(frame),
                       "every instrument once a frame");
    named_in[index] = frame;
    const auto within = [&](const char* column, double most, const char* expected) {
      const double value = table.number(row, column);
      if (!(std::abs(value) <= most)) throw InputError(source, column, table.text(row, column), expected);
      return value;
    };
    constexpr auto radians = "radians: it looks like degrees";
    frames[frame][index] = {within("theta_rad", two_pi, radians), within("phi_rad", two_pi, radians),
                            within("rho_m", 1, "metres: it looks like millimetres"),
                            within("psi_rad", 2 * two_pi, radians)};
  }
  return frames;
}

std::vector<Configurations> read_configurations(const std::filesystem::path& path, const Rig& rig) {
  return configurations_from(CsvTable::read(path), rig, path.string());
}

}  // namespace lapservo::internal
