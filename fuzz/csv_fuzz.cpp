#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "fuzz/require.h"
#include "fuzz/small_rig.h"
#include "lapservo/core/csv.h"
#include "lapservo/io/tables/configuration_csv.h"

// Any text is a table whose numbers are finite, or an InputError. The columns are those of observations and truth.
namespace lapservo::internal::csv_fuzz {
using fuzz::require;

void read_number(const CsvTable& table, std::size_t row, const std::string& column) {
  fuzz::read_or_refuse([&] {
    const auto value = table.number_or_empty(row, column);
    require(!value || std::isfinite(*value), "a number is finite");
    require(value.has_value() == !table.text(row, column).empty(), "only an empty field is no number");
    require(!value || parse_finite(table.text(row, column)) == value, "a field is read in one way");
  });
}

void read_as_configurations(const CsvTable& table) {
  static const Rig rig = fuzz::small_rig(true, false);
  fuzz::read_or_refuse([&] {
    const auto frames = configurations_from(table, rig, "fuzz.csv");
    require(frames.size() * rig.instruments.size() == table.rows(), "every row is used once");
    for (const Configurations& frame : frames)
      for (const JointVector& q : frame) require(q.vector().allFinite(), "q is finite");
  });
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::read_or_refuse([&] {
    const CsvTable table = CsvTable::parse({reinterpret_cast<const char*>(data), size}, "fuzz.csv");
    for (std::size_t row = 0; row < table.rows(); ++row)
      for (const char* column : {"frame", "theta_rad", "phi_rad", "rho_m", "psi_rad", "tau_rad", "e0_u_px"})
        read_number(table, row, column);
    read_as_configurations(table);
    if (table.has("status"))
      for (std::size_t row = 0; row < table.rows(); ++row) {
        const std::string& text = table.text(row, "status");
        require(CsvTable::parse("a,b\n" + csv_field(text) + ",1\n", "again.csv").text(0, "a") == text,
                "a field is written as it was read");
      }
  });
  return 0;
}

}  // namespace lapservo::internal::csv_fuzz
