// How many columns beside the channels a recording's file holds: a reader takes no more.
#pragma once

#include <cstddef>

namespace ferrobench::recordings {

inline constexpr std::size_t most_other_columns = 256;

}  // namespace ferrobench::recordings
