#include "lapservo/vision/status.h"

#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr Words<Status, 11> status_words{{{Status::ok, "ok"},
                                          {Status::no_marker, "no_marker"},
                                          {Status::cut, "cut"},
                                          {Status::occluded, "occluded"},
                                          {Status::ambiguous, "ambiguous"},
                                          {Status::poor_fit, "poor_fit"},
                                          {Status::uncertain, "uncertain"},
                                          {Status::marker_mismatch, "marker_mismatch"},
                                          {Status::damaged, "damaged"},
                                          {Status::interlaced, "interlaced"},
                                          {Status::blended, "blended"}}};
static_assert(names_all(status_words, Status::blended));

}  // namespace

std::string_view to_string(Status status) {
  return word_of(status_words, status);
}

}  // namespace lapservo
