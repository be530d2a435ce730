// The twin against the reference recordings, and the model against the twin.
#include "tests/campaign/twin.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <map>

#include "model/on_recording.h"
#include "recordings/file.h"
#include "tests/model/effects_support.h"

namespace ferrobench::campaign {
namespace {

using model::apart;
using recordings::Channel;

const std::vector<double>& column(const Response& r, Channel c) {
  switch (c) {
    case Channel::charge:
      return r.charge;
    case Channel::displacement:
      return r.displacement;
    case Channel::force:
      return r.force;
    default:
      return r.field;
  }
}

class EachReference : public testing::TestWithParam<std::string> {};

TEST_P(EachReference, IsGivenBackByTheTwin) {
  const auto recording = recordings::read_recording(std::string(MODEL_REFERENCE) + "/" + GetParam() + ".h5");
  const auto source = recording.has(Channel::command) ? Channel::command : Channel::field;
  const auto setting = model::model_for(model::model_from_json(recording.header.model), recording.header);
  const auto begin = std::chrono::steady_clock::now();
  const auto twin = play(setting, {}, recording.time, recording.at(source));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::printf("  %s: %.2f s for %zu samples\n", GetParam().c_str(), seconds, recording.size());
  for (const auto channel : {Channel::charge, Channel::displacement, Channel::force}) {
    const auto& theirs = recording.at(channel);
    const auto [low, high] = std::minmax_element(theirs.begin(), theirs.end());
    if (*high - *low < 1e-9) continue;  // no spring: the force does not move
    const double error = apart(theirs, column(twin, channel));
    std::printf("  %s %.1e\n", std::string(channel_name(channel)).c_str(), error);
    EXPECT_LT(error, 1e-3) << channel_name(channel);
  }
}

INSTANTIATE_TEST_SUITE_P(All, EachReference,
                         testing::Values("single_crystal_free", "single_crystal_spring",
                                         "polycrystal_full_loops", "polycrystal_minor_loops",
                                         "polycrystal_creep_holds", "polycrystal_passive_layers"),
                         [](const auto& i) { return i.param; });

}  // namespace
}  // namespace ferrobench::campaign
