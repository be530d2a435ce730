// Looks through a file for HDF5's global heaps (where texts of variable length lie) and walks each.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace ferrobench::recordings::hdf5 {

// Where the first heap stands whose objects do not fill it exactly; none if all do.
std::optional<std::uint64_t> damaged_heap(const std::string& path);

}  // namespace ferrobench::recordings::hdf5
