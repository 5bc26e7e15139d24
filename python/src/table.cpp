#include <filesystem>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "lapservo/core/error.h"
#include "lapservo/core/row_file.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/io/tables/observation_csv.h"
#include "python/src/bindings.h"
#include "python/src/conversions.h"
#include "python/src/observed.h"

namespace lapservo::python {
namespace {

// The columns of the CSV but for frame, time_s and file, which are the frame's.
py::dict dict_of(const Observed& seen) {
  py::dict values;
  values["stamp_s"] = py::cast(seen.stamp_s);
  values["instrument"] = seen.observation.instrument;
  values["status"] = std::string(to_string(seen.observation.status));
  std::istringstream columns(internal::observation_csv_header);
  std::string column;
  while (column != "status") std::getline(columns, column, ',');
  for (const auto& [value, decimals] : internal::observation_numbers(seen.observation)) {
    std::getline(columns, column, ',');
    values[py::str(column)] = py::cast(value);
  }
  return values;
}

// A context: what left it without an exception is a whole table; rows of any other stay in PATH.part.
class Table {
 public:
  explicit Table(const std::filesystem::path& path) : csv_(std::in_place, path, internal::observation_csv_header) {}
  Table(const Table&) = delete;
  Table& operator=(const Table&) = delete;
  ~Table() { leave_unfinished(); }

  void add(const std::vector<Observed>& observations, const Frame* frame) {
    if (!csv_) throw InputError("ObservationCsv.add", "is called after the end of the table's `with`");
    for (const Observed& seen : observations) {
      if (!frame && !seen.stamp_s)
        throw InputError("ObservationCsv.add", "stamp_s", "None", "a stamp given to track(), or the Frame");
      csv_->add(internal::observation_csv_row(frame ? frame->index : frames_, frame ? frame->time_s : *seen.stamp_s,
                                              frame ? frame->file.filename().string() : "", seen.observation));
      has_rows_ = true;
    }
    ++frames_;
  }
  void leave(const py::object& exception) {
    if (csv_ && exception.is_none()) {
      csv_->commit();
      csv_.reset();
    }
    leave_unfinished();
  }

 private:
  void leave_unfinished() {
    if (csv_ && has_rows_) csv_->leave();
    csv_.reset();
  }

  std::optional<internal::RowFile> csv_;  // until its end
  int frames_ = 0;
  bool has_rows_ = false;
};

}  // namespace

void bind_table(py::module_& m) {
  py::reinterpret_borrow<py::class_<Observed>>(m.attr("Observation"))
      .def("to_dict", &dict_of,
           "The columns of the command line's CSV (docs/output.md), in full digits; None where a number is unknown.");
  py::class_<Table>(m, "ObservationCsv", R"(The command line's table of observations (docs/output.md).

A context: `with ObservationCsv("obs.csv") as table: table.add(tracker.track(frame), frame)`. The file appears under its
name at the end. After an exception, Ctrl-C's too, and without `with`, the rows are in obs.csv.part, and what stood
under the name stays.)")
      .def(py::init<const std::filesystem::path&>(), py::arg("path"))
      .def("add", &Table::add, py::arg("observations"), py::arg("frame") = py::none(),
           "A row for each Observation of one frame: a Frame, or counted from 0 with the stamps given to track().")
      .def("__enter__", [](py::object self) { return self; })
      .def(
          "__exit__",
          [](Table& self, const py::object& kind, const py::object&, const py::object&) { self.leave(kind); },
          py::arg("kind"), py::arg("error"), py::arg("trace"));
}

}  // namespace lapservo::python
