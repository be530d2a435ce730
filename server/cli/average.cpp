#include "server/engine/average.h"

#include <iostream>

#include "base/visible.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "server/cli/cli.h"

namespace ferrobench::cli {

namespace {

struct AverageOptions {
  std::string recording{}, out{};
  bool force = false;
};

int average(const AverageOptions& o, const Common& common) {
  const auto path = recording_argument(o.recording, common);
  const auto existing = demand_free(o.out, o.force, {path});
  const auto mean = server::average_recording(recordings::read_recording(path));
  recordings::write_recording(o.out, mean.recording, existing);
  std::cerr << "The mean of " << mean.in_words() << ".\n";
  for (const auto& why : mean.left_out) std::cerr << visible(why) << '\n';
  std::cout << o.out << '\n';
  return exit_ok;
}

}  // namespace

void add_average(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand(
      "average",
      "The mean over the passes of a recording's averaged repeat, as a recording; prints its file");
  auto o = std::make_shared<AverageOptions>();
  sub->add_option("RECORDING", o->recording, "a file, or the name of a recording in the data folder")
      ->required();
  sub->add_option("--out", o->out, "file of the mean")->type_name("FILE.h5")->required();
  sub->add_flag("--force", o->force, "replace the file if it is there, once the new one is whole");
  sub->footer(
      "A repeat with \"average\": true in its protocol has a mean: over all its passes but the first, which\n"
      "brings the specimen into the loop, and but those that were paused or not played whole.\n"
      "Example:\n  ferrobench average loops.h5 --out mean.h5");
  sub->callback([o, &common] { common.action = [o, &common] { return average(*o, common); }; });
}

}  // namespace ferrobench::cli
