#include "server/methods/read_all.h"

#include "recordings/file/reader.h"
#include "recordings/hdf5/read_apart.h"

namespace ferrobench::server {

namespace {

double bytes_of(const recordings::Recording& r) {
  std::size_t columns = 1 + r.others.size();
  for (const auto channel : recordings::all_channels) columns += r.has(channel) ? 1 : 0;
  return static_cast<double>(sizeof(double) * columns * r.size());
}

}  // namespace

std::vector<recordings::Recording> read_all(const Engine& engine, const std::vector<std::string>& names,
                                            const Jobs::Handle* job) {
  double left = recordings::memory_for_each_recording();
  std::vector<recordings::Recording> out;
  for (const auto& name : names) {
    if (job != nullptr) job->check();
    out.push_back(recordings::read_recording(engine.store().recording(name).string(), left));
    left -= bytes_of(out.back());
  }
  return out;
}

}  // namespace ferrobench::server
