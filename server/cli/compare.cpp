#include <cmath>
#include <iostream>

#include "base/fields.h"
#include "base/number_text.h"
#include "base/visible.h"
#include "recordings/file/reader.h"
#include "server/cli/cli.h"
#include "server/cli/words.h"
#include "server/engine/verify.h"

namespace ferrobench::cli {

namespace {

struct CompareOptions {
  std::string a{}, b{}, format{};
};

void print_values(const char* title, const std::vector<recordings::ValueDifference>& values) {
  constexpr std::size_t most = 20;
  if (!values.empty()) std::printf("\n%s\n", title);
  for (std::size_t i = 0; i < std::min(values.size(), most); ++i)
    std::printf("  %-40s %s | %s\n", visible(excerpt(values[i].place)).c_str(),
                visible(excerpt(values[i].a.dump())).c_str(), visible(excerpt(values[i].b.dump())).c_str());
  if (values.size() > most) std::printf("  and %zu more: --format json\n", values.size() - most);
}

std::string figure(double value) {
  return std::isnan(value) ? "-" : number_text(value);
}

int compare(const CompareOptions& o, const Common& common) {
  const auto difference = recordings::compare(recordings::read_recording(recording_argument(o.a, common)),
                                              recordings::read_recording(recording_argument(o.b, common)));
  const bool same = difference.same_samples() && difference.tables.empty();
  if (o.format == "json") {
    std::cout << to_json(difference).dump(2) << '\n';
    return same ? exit_ok : exit_error;
  }
  std::printf("%-38s %12s %12s %-6s  %s\n", "column", "rms", "maximum", "unit", "first difference");
  for (const auto& c : difference.columns)
    std::printf("%-38s %12s %12s %-6s  %s\n", c.dataset.c_str(), figure(c.rms).c_str(),
                figure(c.maximum).c_str(), c.unit.c_str(), visible(server::in_words(c)).c_str());
  if (difference.by_time) std::printf("%s\n", by_time_in_words(difference).c_str());
  print_values("Status, noise, segments, events (first | second)", difference.tables);
  print_values("What else the files say (first | second)", difference.header);
  std::cout << (same ? "\nThe samples are identical.\n" : "\nThe recordings differ.\n");
  return same ? exit_ok : exit_error;
}

}  // namespace

void add_compare(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand(
      "compare", "Two recordings: rms, maximum and first difference by channel, what else differs");
  auto o = std::make_shared<CompareOptions>();
  sub->add_option("A", o->a, "a file, or the name of a recording in the data folder")->required();
  sub->add_option("B", o->b, "the other")->required();
  sub->add_option("--format", o->format, "text or json")
      ->check(one_of({"text", "json"}))
      ->default_val("text");
  sub->footer(
      "Exit code 1: samples, segments, events, noise or status differ.\n"
      "Example:\n  ferrobench compare monday.h5 tuesday.h5");
  sub->callback([o, &common] { common.action = [o, &common] { return compare(*o, common); }; });
}

}  // namespace ferrobench::cli
