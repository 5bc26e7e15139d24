#include "lapservo/vision/edges/edge_lines.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

#include "lapservo/vision/edges/blurred_edges.h"

// All up to HWY_ONCE is compiled for each instruction set that differs much and whose vectors may stand in arrays.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lapservo/vision/edges/edge_lines.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lapservo::internal {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::ScalableTag<float>;
constexpr std::size_t max_lanes = hn::MaxLanes(Floats()), alignment = max_lanes * sizeof(float);
using Ints = hn::RebindToSigned<Floats>;
using V = hn::Vec<Floats>;
using VI = hn::Vec<Ints>;
using Mask = hn::Mask<Floats>;

// An edge with less information has no contrast.
constexpr float min_edge_information = 1e-9F;
// A shape that differs from the others by less than this part of its square is not set apart by it.
constexpr float least_independent = 1e-5F;
// Iterations end below the first; the last of several may move the edge by the second.
constexpr float edge_tolerance_px = 0.004F, max_last_step_px = 0.25F;
// A channel with fewer samples beyond its unknowns says nothing.
constexpr float least_degrees = 4;

// A value for every lane.
struct Lanes {
  alignas(alignment) std::array<float, max_lanes> value;
  V load() const { return hn::Load(Floats(), value.data()); }
  void store(V values) { hn::Store(values, Floats(), value.data()); }
};

// A value for every sample and lane.
using Column = std::array<Lanes, EdgeLine::max_samples>;

// Lines side by side: lane j is one of them.
struct LineLanes {
  Lanes u, v, du, dv, first, last, blur, radius;
  std::size_t samples = 0;  // of the longest
};

LineLanes lanes_of(std::span<const EdgeLine> lines, std::size_t lanes) {
  LineLanes out;
  for (std::size_t j = 0; j < lanes; ++j) {
    const EdgeLine& line = lines[std::min(j, lines.size() - 1)];
    out.u.value[j] = line.u_px, out.v.value[j] = line.v_px;
    out.du.value[j] = line.du, out.dv.value[j] = line.dv;
    out.first.value[j] = static_cast<float>(-line.before), out.last.value[j] = static_cast<float>(line.after);
    out.blur.value[j] = line.blur_px, out.radius.value[j] = line.contour_radius_px;
    out.samples = std::max(out.samples, static_cast<std::size_t>(line.before + line.after + 1));
  }
  return out;
}

struct SampledLanes {
  std::array<Column, 3> light, present;  // present: 1 where a channel's light is known, 0 (and no light) elsewhere
  bool alike;                            // present in all channels alike
};

// The four pixels around a place, in each lane: two words a row hold blue, green and red of both.
struct Neighbours {
  alignas(alignment) std::array<std::array<std::int32_t, max_lanes>, 4> words;

  void load(const ImageView& image, VI u, VI v, std::size_t lanes) {
    alignas(alignment) std::array<std::int32_t, max_lanes> us, vs;
    hn::Store(u, Ints(), us.data());
    hn::Store(v, Ints(), vs.data());
    for (std::size_t j = 0; j < lanes; ++j) {
      const std::uint8_t* top = image.pixel(us[j], vs[j]);
      const std::uint8_t* bottom = top + image.row_bytes;
      std::memcpy(&words[0][j], top, 4);
      std::memcpy(&words[1][j], top + 2, 4);
      std::memcpy(&words[2][j], bottom, 4);
      std::memcpy(&words[3][j], bottom + 2, 4);
    }
  }
  // Channel c of the left or right pixel of the upper or lower row.
  VI value(std::size_t c, std::size_t right, std::size_t lower) const {
    const std::size_t byte = c + 3 * right;
    const VI word = hn::Load(Ints(), words[2 * lower + (byte > 3 ? 1 : 0)].data());
    const int bits = 8 * static_cast<int>(byte > 3 ? byte - 2 : byte);
    return hn::And(hn::ShiftRightSame(word, bits), hn::Set(Ints(), 255));
  }
};

// LightImage::at() in every lane and at every sample.
template <bool Chromatic>
SampledLanes sample(const LightImage& light, const LineLanes& lines) {
  const Floats d;
  const std::size_t lanes = hn::Lanes(d);
  const V one = hn::Set(d, 1);
  const VI saturated = hn::Set(Ints(), LightImage::saturated_value);
  SampledLanes out;
  Neighbours around;
  VI brightest = hn::Zero(Ints());
  V unlimited = lines.first.load();
  for (std::size_t i = 0; i < lines.samples; ++i, unlimited = hn::Add(unlimited, one)) {
    const V t = hn::Min(unlimited, lines.last.load());
    const V green_u = hn::MulAdd(t, lines.du.load(), lines.u.load());
    const V green_v = hn::MulAdd(t, lines.dv.load(), lines.v.load());
    V fu, fv;
    const auto look_at = [&](V u, V v) HWY_ATTR {
      const VI left = hn::ConvertTo(Ints(), u), top = hn::ConvertTo(Ints(), v);
      fu = hn::Sub(u, hn::ConvertTo(d, left)), fv = hn::Sub(v, hn::ConvertTo(d, top));
      around.load(light.image(), left, top, lanes);
    };
    if constexpr (!Chromatic) look_at(green_u, green_v);
    for (std::size_t c = 0; c < 3; ++c) {
      if constexpr (Chromatic) {
        const ChannelGeometry& channels = light.channels();
        const V magnification = hn::Set(d, channels.magnification[c]);
        const V centre_u = hn::Set(d, channels.centre_u), centre_v = hn::Set(d, channels.centre_v);
        look_at(hn::MulAdd(magnification, hn::Sub(green_u, centre_u), centre_u),
                hn::MulAdd(magnification, hn::Sub(green_v, centre_v), centre_v));
      }
      VI brightest_here = hn::Zero(Ints());
      const auto at = [&](std::size_t right, std::size_t lower) HWY_ATTR {
        const VI value = around.value(c, right, lower);
        brightest_here = hn::Max(brightest_here, value);
        return hn::GatherIndex(Floats(), light.light_of_value().data(), value);
      };
      const V a = at(0, 0), b = at(1, 0), e = at(0, 1), f = at(1, 1);
      const V upper = hn::MulAdd(fu, hn::Sub(b, a), a), lower = hn::MulAdd(fu, hn::Sub(f, e), e);
      const Mask known = hn::And(hn::Eq(t, unlimited), hn::RebindMask(d, hn::Lt(brightest_here, saturated)));
      out.present[c][i].store(hn::IfThenElseZero(known, one));
      out.light[c][i].store(hn::IfThenElseZero(known, hn::MulAdd(fv, hn::Sub(lower, upper), upper)));
      brightest = hn::Max(brightest, brightest_here);
    }
  }
  out.alike = hn::AllTrue(Ints(), hn::Lt(brightest, saturated));
  return out;
}

// BlurredEdges::at() in every lane.
struct BlurredLanes {
  V density, step, root, three_halves, root_slope;
};

template <bool WithRoots>
HWY_INLINE BlurredLanes blurred_at(const BlurredEdge* table, V u) {
  const Floats d;
  const V first = hn::Set(d, BlurredEdges::first_u), last = hn::Set(d, BlurredEdges::last_u);
  const V per_sigma = hn::Set(d, static_cast<float>(BlurredEdges::per_sigma));
  const V place = hn::Mul(hn::Sub(hn::Min(hn::Max(u, first), last), first), per_sigma);
  const VI i = hn::ConvertTo(Ints(), place);
  const V f = hn::Sub(place, hn::ConvertTo(d, i));
  constexpr int stride = sizeof(BlurredEdge) / sizeof(float);
  const VI index = hn::Mul(i, hn::Set(Ints(), stride));
  const auto field = [&](int offset) HWY_ATTR {
    const float* entries = &table->density + offset;
    const V here = hn::GatherIndex(d, entries, index), next = hn::GatherIndex(d, entries + stride, index);
    return hn::MulAdd(f, hn::Sub(next, here), here);
  };
  BlurredLanes edge{field(0), field(1), V(), V(), V()};
  if constexpr (WithRoots) {
    const Mask far = hn::Gt(u, last);
    const V safe = hn::Max(u, last), root = hn::Sqrt(safe),
            correction = hn::Div(hn::Set(d, 1.0F / 8), hn::Mul(safe, safe));
    const V one = hn::Set(d, 1), three = hn::Set(d, 3);
    edge.root = hn::IfThenElse(far, hn::Mul(root, hn::Sub(one, correction)), field(2));
    edge.three_halves = hn::IfThenElse(far, hn::Mul(hn::Mul(root, safe), hn::MulAdd(three, correction, one)), field(3));
    edge.root_slope = hn::IfThenElse(far, hn::Div(hn::MulAdd(three, correction, one), hn::Add(root, root)), field(4));
  }
  return edge;
}

// The dot products of `Count` columns with one, which is read once.
template <std::size_t Count>
HWY_INLINE std::array<V, Count> dots(const Column* columns, const Column& with, std::size_t samples) {
  std::array<V, Count> sums;
  sums.fill(hn::Zero(Floats()));
  for (std::size_t i = 0; i < samples; ++i) {
    const V here = with[i].load();
    for (std::size_t k = 0; k < Count; ++k) sums[k] = hn::MulAdd(columns[k][i].load(), here, sums[k]);
  }
  return sums;
}

HWY_INLINE V dot(const Column& a, const Column& b, std::size_t samples) {
  return dots<1>(&a, b, samples)[0];
}

// The model's linear basis, a constant and then the shapes, made orthonormal; and the shapes' derivatives by the edge's
// position and then by the blur, with the Gram matrix of what the basis can't imitate of them. Where samples are
// present.
template <std::size_t Shapes>
struct Basis {
  static constexpr std::size_t linear = Shapes + 1, derivatives = 2 * Shapes, all = linear + derivatives;

  std::array<Column, all> columns;
  std::array<std::array<V, linear>, linear> triangle;       // of the orthogonalisation
  std::array<std::array<V, linear>, derivatives> imitated;  // of each derivative, along each unit
  std::array<std::array<V, derivatives>, derivatives> gram;
  V degrees;  // samples beyond the unknowns
  Mask determined;

  void set(const LineLanes& lines, const Column& present, V edge_px) {
    fill(lines, present, edge_px);
    orthogonalise(lines.samples);
    for (std::size_t s = 0; s < derivatives; ++s) {
      const auto products = dots<all>(columns.data(), columns[linear + s], lines.samples);
      std::copy_n(products.begin(), linear, imitated[s].begin());
      for (std::size_t r = 0; r <= s; ++r) {
        V left = products[linear + r];
        for (std::size_t j = 0; j < linear; ++j) left = hn::NegMulAdd(imitated[s][j], imitated[r][j], left);
        gram[s][r] = gram[r][s] = left;
      }
    }
  }

 private:
  // One shape: a step. The second one: sqrt(1 - (1 - d/R)^2) = sqrt(2 d / R) (1 - d / 4R - ...), the occluding contour
  // within a third of the radius.
  void fill(const LineLanes& lines, const Column& present, V edge_px) {
    const Floats d;
    const V one = hn::Set(d, 1), blur = lines.blur.load(), inverse_blur = hn::Div(one, blur);
    V rise = one, fall = one, bend = one;
    if constexpr (Shapes == 2) {
      const V radius = lines.radius.load(), root_blur = hn::Sqrt(blur);
      const V root_scale = hn::Sqrt(hn::Div(hn::Set(d, 2), radius));
      rise = hn::Mul(root_scale, root_blur), fall = hn::Div(root_scale, root_blur);
      bend = hn::Div(blur, hn::Mul(hn::Set(d, 4), radius));
    }
    const BlurredEdge* table = BlurredEdges::instance().entries.data();
    V from_edge = hn::Sub(lines.first.load(), edge_px);
    for (std::size_t i = 0; i < lines.samples; ++i, from_edge = hn::Add(from_edge, one)) {
      const V here = present[i].load(), u = hn::Mul(from_edge, inverse_blur);
      const BlurredLanes edge = blurred_at<Shapes == 2>(table, u);
      const V slope = hn::Neg(hn::Mul(hn::Mul(here, edge.density), inverse_blur));
      columns[0][i].store(here);
      columns[1][i].store(hn::Mul(here, edge.step));
      columns[linear][i].store(slope);
      columns[linear + Shapes][i].store(hn::Mul(slope, u));
      if constexpr (Shapes == 2) {
        const V up = hn::Mul(here, rise), down = hn::Mul(here, fall);
        const V bent = hn::Mul(hn::Mul(bend, hn::Set(d, 3.0F / 2)), edge.root);
        columns[2][i].store(hn::Mul(up, hn::NegMulAdd(bend, edge.three_halves, edge.root)));
        columns[linear + 1][i].store(hn::Mul(down, hn::Sub(bent, edge.root_slope)));
        columns[linear + 3][i].store(
            hn::Mul(down, hn::NegMulAdd(u, edge.root_slope, hn::Mul(hn::Set(d, 0.5F), edge.root))));
      }
    }
  }

  void orthogonalise(std::size_t samples) {
    const Floats d;
    const V one = hn::Set(d, 1);
    for (std::size_t j = 0; j < linear; ++j) {
      Column& column = columns[j];
      const V before = dot(column, column, samples);
      if (j == 0) {
        degrees = hn::Sub(before, hn::Set(d, static_cast<float>(linear)));
        determined = hn::Ge(degrees, hn::Set(d, least_degrees));
      }
      for (std::size_t k = 0; k < j; ++k) {
        triangle[k][j] = dot(columns[k], column, samples);
        for (std::size_t i = 0; i < samples; ++i)
          column[i].store(hn::NegMulAdd(triangle[k][j], columns[k][i].load(), column[i].load()));
      }
      const V square = dot(column, column, samples);
      determined = hn::And(determined, hn::Gt(square, hn::Mul(hn::Set(d, least_independent), before)));
      triangle[j][j] = hn::Sqrt(hn::IfThenElse(determined, square, one));
      const V factor = hn::Div(one, triangle[j][j]);
      for (std::size_t i = 0; i < samples; ++i) column[i].store(hn::Mul(factor, column[i].load()));
    }
  }
};

// EdgeFit in every lane.
struct FitLanes {
  enum Value { offset, information, residual_variance, blur_gradient, blur_information, step, before = step + 3 };
  std::array<V, before + 3> value;
  Mask converged;
};

// One variable-projection step: linear amplitudes per channel, then the position in what they leave. A channel that
// does not determine its amplitudes counts for nothing. `squares`: of each channel's light, their sum.
template <std::size_t Shapes>
FitLanes project(const LineLanes& lines, const SampledLanes& sampled, const std::array<V, 3>& squares, V edge_px) {
  const Floats d;
  const V zero = hn::Zero(d);
  Basis<Shapes> basis;
  constexpr std::size_t linear = Basis<Shapes>::linear;
  FitLanes fit;
  fit.value.fill(zero);
  // By position, then by blur.
  std::array<V, 2> gradient{zero, zero};
  std::array<std::array<V, 2>, 2> information{gradient, gradient};
  V degrees = hn::Set(d, -1), left_squares = zero;
  for (std::size_t c = 0; c < 3; ++c) {
    if (c == 0 || !sampled.alike) basis.set(lines, sampled.present[c], edge_px);
    const auto products = dots<Basis<Shapes>::all>(basis.columns.data(), sampled.light[c], lines.samples);
    std::array<V, linear> amplitude;
    V left_of_channel = squares[c];
    for (std::size_t j = 0; j < linear; ++j) {
      amplitude[j] = products[j];
      left_of_channel = hn::NegMulAdd(amplitude[j], amplitude[j], left_of_channel);
    }
    degrees = hn::Add(degrees, hn::IfThenElseZero(basis.determined, basis.degrees));
    left_squares = hn::Add(left_squares, hn::IfThenElseZero(basis.determined, left_of_channel));
    for (std::size_t j = linear; j-- > 0;) {
      for (std::size_t k = j + 1; k < linear; ++k)
        amplitude[j] = hn::NegMulAdd(basis.triangle[j][k], amplitude[k], amplitude[j]);
      amplitude[j] = hn::IfThenElseZero(basis.determined, hn::Div(amplitude[j], basis.triangle[j][j]));
    }
    fit.value[FitLanes::before + c] = amplitude[0];
    for (std::size_t s = 0; s < Shapes; ++s) {
      const V a = amplitude[s + 1];
      for (std::size_t by = 0; by < 2; ++by) {
        const std::size_t derivative = by * Shapes + s;
        V left = products[linear + derivative];
        for (std::size_t j = 0; j < linear; ++j) left = hn::NegMulAdd(basis.imitated[derivative][j], products[j], left);
        gradient[by] = hn::MulAdd(a, left, gradient[by]);
        for (std::size_t and_by = by; and_by < 2; ++and_by)
          for (std::size_t t = 0; t < Shapes; ++t)
            information[by][and_by] = hn::MulAdd(hn::Mul(a, amplitude[t + 1]),
                                                 basis.gram[derivative][and_by * Shapes + t], information[by][and_by]);
      }
      V& step = fit.value[FitLanes::step + c];
      step = hn::Add(step, a);
    }
  }
  const V offset = hn::Div(gradient[0], information[0][0]), both = information[0][1];
  const V variance = hn::Div(hn::Max(zero, left_squares), degrees);
  fit.value[FitLanes::offset] = offset;
  fit.value[FitLanes::information] = information[0][0];
  fit.value[FitLanes::residual_variance] = variance;
  // For the blur, whatever the position is.
  fit.value[FitLanes::blur_gradient] = hn::NegMulAdd(offset, both, gradient[1]);
  fit.value[FitLanes::blur_information] = hn::NegMulAdd(hn::Div(both, information[0][0]), both, information[1][1]);
  fit.converged = hn::And(hn::Gt(information[0][0], hn::Set(d, min_edge_information)),
                          hn::And(hn::IsFinite(offset), hn::IsFinite(variance)));
  return fit;
}

template <std::size_t Shapes>
FitLanes iterate(const LineLanes& lines, const SampledLanes& sampled, int iterations) {
  const Floats d;
  std::array<V, 3> squares;
  for (std::size_t c = 0; c < 3; ++c) squares[c] = dot(sampled.light[c], sampled.light[c], lines.samples);
  const V samples = hn::Add(hn::Sub(lines.last.load(), lines.first.load()), hn::Set(d, 1));
  const V reach = hn::Mul(hn::Set(d, 0.5F), samples);
  V edge_px = hn::Zero(d);
  FitLanes fit{};
  Mask active = hn::Eq(edge_px, edge_px);
  for (int iteration = 0; iteration < iterations && !hn::AllFalse(d, active); ++iteration) {
    const FitLanes next = project<Shapes>(lines, sampled, squares, edge_px);
    for (std::size_t i = 0; i < fit.value.size(); ++i)
      fit.value[i] = hn::IfThenElse(active, next.value[i], fit.value[i]);
    fit.converged = hn::Or(hn::And(active, next.converged), hn::AndNot(active, fit.converged));
    active = hn::And(active, fit.converged);
    const V step = hn::Min(hn::Max(fit.value[FitLanes::offset], hn::Set(d, -2)), hn::Set(d, 2));
    edge_px = hn::IfThenElse(active, hn::Add(edge_px, step), edge_px);
    fit.converged = hn::And(fit.converged, hn::Le(hn::Abs(edge_px), reach));
    active = hn::And(hn::And(active, fit.converged), hn::Ge(hn::Abs(step), hn::Set(d, edge_tolerance_px)));
  }
  const V largest = hn::Set(d, iterations > 1 ? max_last_step_px : max_only_step_px);
  V& offset = fit.value[FitLanes::offset];
  fit.converged = hn::And(fit.converged, hn::Lt(hn::Abs(offset), largest));
  offset = edge_px;
  return fit;
}

template <std::size_t Shapes>
void locate(const LightImage& image, std::span<const EdgeLine> lines, int iterations, EdgeFits& fits) {
  const Floats d;
  const LineLanes lanes = lanes_of(lines, hn::Lanes(d));
  const SampledLanes sampled = image.channels().differs() ? sample<true>(image, lanes) : sample<false>(image, lanes);
  const FitLanes fit = iterate<Shapes>(lanes, sampled, iterations);
  std::array<Lanes, std::tuple_size_v<decltype(fit.value)>> values;
  for (std::size_t i = 0; i < values.size(); ++i) values[i].store(fit.value[i]);
  Lanes converged;
  converged.store(hn::IfThenElseZero(fit.converged, hn::Set(d, 1)));
  for (std::size_t j = 0; j < lines.size(); ++j) {
    const auto of = [&](FitLanes::Value value, std::size_t c = 0) { return values[value + c].value[j]; };
    const auto bgr_of = [&](FitLanes::Value value) { return std::array{of(value), of(value, 1), of(value, 2)}; };
    using enum FitLanes::Value;
    fits.push_back({converged.value[j] > 0, of(offset), of(information), of(residual_variance), bgr_of(step),
                    bgr_of(before), of(blur_gradient), of(blur_information)});
  }
}

EdgeFits locate_edges(const LightImage& image, std::span<const EdgeLine> lines, int iterations) {
  EdgeFits fits;
  const std::size_t lanes = hn::Lanes(Floats());
  for (std::size_t i = 0; i < lines.size(); i += lanes) {
    const auto some = lines.subspan(i, std::min(lanes, lines.size() - i));
    lines[0].contour_radius_px > 0 ? locate<2>(image, some, iterations, fits)
                                   : locate<1>(image, some, iterations, fits);
  }
  return fits;
}

}  // namespace HWY_NAMESPACE
}  // namespace lapservo::internal
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lapservo::internal {

HWY_EXPORT(locate_edges);

EdgeFits locate_edges(const LightImage& light, std::span<const EdgeLine> lines, int iterations) {
  return HWY_DYNAMIC_DISPATCH(locate_edges)(light, lines, iterations);
}

}  // namespace lapservo::internal
#endif
