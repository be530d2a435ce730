// Loops over threads.
#pragma once

#include <cstddef>
#include <functional>

namespace ferrobench::model::inference {

// Calls task(0 .. count-1), spread over so many threads; the first exception is thrown again. A loop within a
// task runs on that task's thread alone.
void in_parallel(std::size_t count, int threads, const std::function<void(std::size_t)>& task);

}  // namespace ferrobench::model::inference
