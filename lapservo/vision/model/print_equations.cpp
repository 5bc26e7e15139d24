#include "lapservo/vision/model/print_equations.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <Eigen/Cholesky>

#include "lapservo/vision/model/normal_equations.h"

namespace lapservo::internal {
namespace {

// Sums over a group of the weighted products of: the row of pose and film, that of the print's errors at its two edges,
// the residual, and 1. They are symmetric: the lower half is summed, at a fixed size, which is several times faster.
class Products {
 public:
  static constexpr int at_print = fit_unknowns, at_residual = at_print + 2, at_one = at_print + 3;

  void add(const Measurement& m, double weight) {
    Row row = Row::Zero();
    row.head<fit_unknowns>() = m.row;
    row.segment<2>(at_print) = print_row(m);
    row[at_residual] = m.residual_px;
    row[at_one] = 1;
    add_columns(row, weight, std::make_integer_sequence<int, at_one + 1>());
  }
  auto both_halves() const { return Square(lower_.selfadjointView<Eigen::Lower>()); }

 private:
  static constexpr int size = at_one + 1 + (at_one + 1) % 2;  // a whole number of registers
  using Row = Eigen::Matrix<double, size, 1>;
  using Square = Eigen::Matrix<double, size, size>;

  template <int... Columns>
  void add_columns(const Row& row, double weight, std::integer_sequence<int, Columns...>) {
    (add_column<Columns>(row, weight), ...);
  }
  template <int Column>
  void add_column(const Row& row, double weight) {
    constexpr int count = size - (Column - Column % 2);  // from a register's first on
    lower_.col(Column).tail<count>() += (weight * row[Column]) * row.tail<count>();
  }

  Square lower_ = Square::Zero();
};

// Adds a group's products to the sums of all, and returns its pull.
GroupPull gathered(const Products& products, std::size_t group, PrintEquations& all) {
  constexpr int print = Products::at_print, residual = Products::at_residual, one = Products::at_one;
  const auto sums = products.both_halves();
  GroupPull pull;
  pull.x = sums.col(one).head<fit_unknowns>();
  pull.weight = sums(one, one);
  pull.residual = sums(one, residual);
  all.xx += sums.topLeftCorner<fit_unknowns, fit_unknowns>();
  all.x += sums.col(residual).head<fit_unknowns>();
  if (group >= errors_of_boundary.size()) return pull;
  const auto& errors = errors_of_boundary[group];
  for (const int edge : {0, 1}) {
    const int error = errors[static_cast<std::size_t>(edge)];
    all.nx.row(error) += sums.row(print + edge).head<fit_unknowns>();
    for (const int other : {0, 1})
      all.nn(error, errors[static_cast<std::size_t>(other)]) += sums(print + edge, print + other);
    all.n[error] += sums(print + edge, residual);
    pull.n[error] += sums(print + edge, one);
  }
  return pull;
}

double certainty_of(const Measurement& m, const CommonErrors& errors) {
  const double sigmas = errors.lines[m.group].residual_px(m) / m.sigma_px,
               noise_px = errors.noise_scale(m) * m.sigma_px;
  return cauchy_weight(sigmas) / (noise_px * noise_px);
}

// All boundaries moved alike, leaning alike, or bowed alike.
void add_pulls_of_all(std::span<const Measurement> measurements, const CommonErrors& errors, PrintSums& sums) {
  const std::array<double, 3> patterns_px{errors.whole_px, errors.leaning_px, errors.bowed_px};
  std::array<GroupPull, 3> pulls;
  std::array<double, 3> squares{};
  double all = 0;
  for (const Measurement& m : measurements) {
    if (m.group >= errors_of_boundary.size()) continue;
    const double weight = certainty_of(m, errors);
    const std::array<double, 3> moved{1, m.across, m.across * m.across - 1.0 / 3};
    for (std::size_t i = 0; i < pulls.size(); ++i) {
      const double part = weight * moved[i];
      pulls[i].add(m, part);
      squares[i] += part * moved[i];
    }
    all += weight;
  }
  for (std::size_t i = 0; i < pulls.size(); ++i) {
    if (!(squares[i] > 0 && patterns_px[i] > 0)) continue;
    pulls[i].error_px = patterns_px[i] * std::sqrt(all / squares[i]);
    sums.of_all_boundaries.push_back(pulls[i]);
  }
}

// One sigma of each number of the rig's camera and marker.
void add_pulls_of_camera(std::span<const Measurement> measurements, const CommonErrors& errors, PrintSums& sums) {
  std::array<CameraPull, RigErrors::most> pulls;
  for (const Measurement& m : measurements) {
    const RigErrors::Shifts shifts = certainty_of(m, errors) * errors.rig->of(m);
    for (int i = 0; i < RigErrors::most; ++i) {
      CameraPull& pull = pulls[static_cast<std::size_t>(i)];
      pull.add(m, shifts[i]);
      pull.by_group[m.group] += shifts[i];
    }
  }
  for (CameraPull& pull : pulls) {
    if (pull.x.isZero(0)) continue;  // the rig has no sigma of it
    pull.error_px = 1;
    sums.camera.push_back(pull);
  }
}

double certainty_of(const GroupPull& group) {
  return 1 / (group.weight + 1 / (group.error_px * group.error_px));
}

// How one sigma of a number of the rig pulls the print's errors, whatever pose, film and groups' errors are.
PrintVector print_pull_of(const CameraPull& pull, const PrintSums& sums, const PrintCrossMatrix& through) {
  UnknownVector x = pull.x;
  PrintVector n = pull.n;
  for (std::size_t group = 0; group < measurement_groups; ++group) {
    const GroupPull& of_group = sums.pulls[group];
    if (!(of_group.weight > 0) || pull.by_group[group] == 0) continue;
    const double part = certainty_of(of_group) * pull.by_group[group];
    x -= part * of_group.x, n -= part * of_group.n;
  }
  return n - through * x;
}

// Errors of the print that look like one sigma of each number of the rig.
InplaceVector<PrintVector, RigErrors::most> shapes_of_camera(const PrintInformation& print, const PrintSums& sums,
                                                             const PrintCrossMatrix& through) {
  PrintMatrix solvable = print.information;
  solvable.diagonal().array() += ridge * print.information.trace();
  const Eigen::LDLT<PrintMatrix> factor(solvable);
  InplaceVector<PrintVector, RigErrors::most> shapes;
  for (const CameraPull& pull : sums.camera) shapes.push_back(factor.solve(print_pull_of(pull, sums, through)));
  return shapes;
}

}  // namespace

PrintSums print_sums(std::span<const Measurement> measurements, double film_prior, const CommonErrors& errors) {
  std::array<Products, measurement_groups> products;
  for (const Measurement& m : measurements) products[m.group].add(m, certainty_of(m, errors));
  PrintSums sums;
  for (std::size_t group = 0; group < measurement_groups; ++group) {
    sums.pulls[group] = gathered(products[group], group, sums.equations);
    sums.pulls[group].error_px = errors.px[group];
  }
  sums.equations.add(UnknownVector::Unit(film_unknown), PrintVector::Zero(), 1, film_prior);
  if (errors.whole_px > 0 || errors.leaning_px > 0 || errors.bowed_px > 0) add_pulls_of_all(measurements, errors, sums);
  if (errors.rig) add_pulls_of_camera(measurements, errors, sums);
  return sums;
}

PrintSums held(PrintSums sums, const RcmMeasurement& rcm) {
  sums.equations.xx += rcm.rows.transpose() * rcm.rows;
  sums.equations.x += rcm.rows.transpose() * rcm.residual;
  return sums;
}

PrintInformation information_of(const PrintSums& sums) {
  PrintEquations e = sums.equations;
  for (const GroupPull& pull : sums.pulls)
    if (pull.weight > 0) e.add(pull.x, pull.n, -certainty_of(pull), pull.residual);
  const auto inverse = inverse_of(e.xx);
  if (!inverse) return {};
  const PrintCrossMatrix through = e.nx.lazyProduct(*inverse);
  const PrintInformation print{e.nn - through.lazyProduct(e.nx.transpose()), e.n - through.lazyProduct(e.x)};
  return sums.camera.empty() ? print : doubted(print, shapes_of_camera(print, sums, through));
}

std::optional<PrintSolution> solved_with_print(const PrintSums& sums, const PrintPrior& prior) {
  const PrintEquations& e = sums.equations;
  const PrintMatrix print_covariance = covariance_of(e.nn, prior);
  const PrintCrossMatrix by_x = print_covariance.lazyProduct(e.nx);
  const auto inverted = inverse_of(e.xx - e.nx.transpose().lazyProduct(by_x));
  if (!inverted) return std::nullopt;
  const UnknownMatrix& inverse = *inverted;
  PrintSolution solution;
  solution.inverse = inverse;
  solution.step = inverse * (e.x - by_x.transpose() * e.n);
  solution.print_mm = print_covariance * (e.n - e.nx * solution.step);
  solution.covariance = inverse;
  const auto widen = [&](const GroupPull& pull) {
    const UnknownVector error = pull.error_px * (inverse * (pull.x - by_x.transpose() * pull.n));
    solution.covariance.noalias() += error * error.transpose();
  };
  for (const GroupPull& pull : sums.pulls) widen(pull);
  for (const GroupPull& pull : sums.of_all_boundaries) widen(pull);
  for (const CameraPull& pull : sums.camera) widen(pull);
  const bool finite = solution.covariance.allFinite() && solution.step.allFinite() && solution.print_mm.allFinite();
  return finite && (solution.covariance.diagonal().array() > 0).all() ? std::optional(solution) : std::nullopt;
}

}  // namespace lapservo::internal
