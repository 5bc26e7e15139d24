#include "lapservo/vision/status.h"

#include <array>

#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;

constexpr auto status_words = std::to_array<Word<Status>>({{Status::ok, "ok"},
                                                           {Status::no_marker, "no_marker"},
                                                           {Status::cut, "cut"},
                                                           {Status::occluded, "occluded"},
                                                           {Status::ambiguous, "ambiguous"},
                                                           {Status::poor_fit, "poor_fit"},
                                                           {Status::uncertain, "uncertain"},
                                                           {Status::marker_mismatch, "marker_mismatch"},
                                                           {Status::damaged, "damaged"},
                                                           {Status::interlaced, "interlaced"},
                                                           {Status::blended, "blended"}});
static_assert(names_all(status_words, Status::blended));

std::string_view to_string(Status status) {
  return word_of(status_words, status);
}

}  // namespace lapservo
