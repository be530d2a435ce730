// ferrobench_campaign: makes simulated benches for a batch of discoveries, and counts what came of it.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <mutex>
#include <optional>
#include <sstream>

#include "model/inference/common/parallel.h"
#include "tests/campaign/table.h"
#include "tests/campaign/thresholds.h"

namespace ferrobench::campaign {

using nlohmann::json;

namespace {

constexpr std::string_view usage =
    "ferrobench_campaign --write FOLDER [--benches N] [--seed S] [--kind K] [--first I] [--jobs J] "
    "[--commanded SHARE] "
    "[--vary V,V]\n"
    "ferrobench_campaign --judge FOUND --read FOLDER [--json OUT] [--strict yes]\n"
    "ferrobench_campaign --thresholds LOG --read FOLDER [--benches N] [--first I] [--jobs J] [--only T,T]\n"
    "  --write  makes benches (model.json, truth.json, *.h5) in FOLDER/bench-NNN, and FOLDER/manifest.json "
    "for\n"
    "           'ferrobench batch discover FOLDER/manifest.json --out FOUND'\n"
    "  --judge  counts the answers of that batch against what was hidden in the benches of --read\n"
    "  --thresholds  asks the benches of --read in this process, with each threshold of the search halved\n"
    "           and doubled; LOG keeps a line for each answer, and what it holds is not asked again\n"
    "  --only   of these thresholds alone\n"
    "  --kind   single | pair | nothing | moved | outside | withheld | coloured | physics; without it a\n"
    "           mixture of all but the last\n"
    "  --first  index of the first bench\n"
    "  --jobs   benches that are made at a time (1)\n"
    "  --commanded  share of the benches whose recordings hold the command (0.85); where the drive is at "
    "fault\n"
    "           they always do\n"
    "  --vary   any of low_noise,few_recordings,past,charge_only\n"
    "  --json   a file for all that is counted\n"
    "  --strict yes: exit code 2 unless every answer is right\n";

constexpr std::string_view see = "; see --help";

struct Arguments {
  int benches = 25, first = 0, jobs = 1;
  std::uint64_t seed = 1;
  std::optional<Kind> kind;
  BenchOptions bench{};
  std::string write, judge, thresholds, read, json;
  std::vector<std::string> only;
  bool strict = false;
};

Error bad(const std::string& name, const std::string& given, const std::string& wanted) {
  return Error(ErrorCode::invalid_params, name + " was given \"" + given + "\"; it wants " + wanted);
}

template <class Number>
Number number(const std::string& name, const std::string& text) {
  Number out{};
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), out);
  if (code != std::errc{} || end != text.data() + text.size() || out < 0)
    throw bad(name, text, "a number of 0 or more");
  return out;
}

std::vector<std::string> words_of(const std::string& list) {
  std::vector<std::string> out;
  std::istringstream words(list);
  for (std::string word; std::getline(words, word, ',');) out.push_back(word);
  return out;
}

void vary(BenchOptions& bench, const std::string& what) {
  const std::map<std::string, bool*> places{{"low_noise", &bench.low_noise},
                                            {"few_recordings", &bench.few_recordings},
                                            {"past", &bench.past},
                                            {"charge_only", &bench.charge_only}};
  for (const auto& word : words_of(what)) {
    const auto place = places.find(word);
    if (place == places.end()) throw bad("--vary", word, "low_noise, few_recordings, past, charge_only");
    *place->second = true;
  }
}

Arguments parse(std::span<char*> words) {
  Arguments a;
  for (std::size_t i = 1; i < words.size(); i += 2) {
    const std::string name = words[i];
    if (i + 1 == words.size())
      throw Error(ErrorCode::invalid_params, name + " needs a value" + std::string(see));
    const std::string value = words[i + 1];
    if (name == "--benches") {
      a.benches = number<int>(name, value);
    } else if (name == "--first") {
      a.first = number<int>(name, value);
    } else if (name == "--seed") {
      a.seed = number<std::uint64_t>(name, value);
    } else if (name == "--jobs") {
      a.jobs = std::max(1, number<int>(name, value));
    } else if (name == "--commanded") {
      a.bench.commanded = number<double>(name, value);
      if (a.bench.commanded > 1) throw bad(name, value, "a share, 0 to 1");
    } else if (name == "--write") {
      a.write = value;
    } else if (name == "--judge") {
      a.judge = value;
    } else if (name == "--read") {
      a.read = value;
    } else if (name == "--thresholds") {
      a.thresholds = value;
    } else if (name == "--only") {
      a.only = words_of(value);
    } else if (name == "--json") {
      a.json = value;
    } else if (name == "--vary") {
      vary(a.bench, value);
    } else if (name == "--strict") {
      if (value != "yes" && value != "no") throw bad(name, value, "yes or no");
      a.strict = value == "yes";
    } else if (name == "--kind") {
      a.kind = kind_named(value);
    } else {
      throw Error(ErrorCode::invalid_params, name + " is not known" + std::string(see));
    }
  }
  const bool reads = !a.judge.empty() || !a.thresholds.empty();
  if (a.write.empty() + a.judge.empty() + a.thresholds.empty() != 2 || reads == a.read.empty())
    throw Error(ErrorCode::invalid_params,
                "either --write is wanted, or --judge or --thresholds with --read" + std::string(see));
  return a;
}

std::string line_of(const Bench& bench, double seconds) {
  const auto truth = truth_of(bench);
  std::string effects;
  for (const auto& e : truth["effects"])
    effects += fmt::format(" {} {} size {:.3g}", e["id"].get<std::string>(), e["parameters"].dump(),
                           e["size"].get<double>());
  for (const auto& p : truth["physics"]) effects += " with " + p.dump();
  if (bench.left > 0) effects += fmt::format(" that leave {:.3g}", bench.left);
  std::size_t samples = 0;
  for (const auto& r : bench.recordings) samples += r.recording.size();
  return fmt::format("{} {}{}, {} samples, {:.1f} s", name_of(bench.index), kind_name(bench.kind), effects,
                     samples, seconds);
}

// One item of the batch: what discover is asked of the bench.
json item_of(const Bench& bench) {
  const auto name = name_of(bench.index);
  json options{{"seed", bench.seed}, {"report", false}};
  if (!bench.candidates.empty()) options["candidates"] = bench.candidates;
  json files = json::array();
  for (const auto& r : bench.recordings) files.push_back(name + "/" + r.name + ".h5");
  return {{"id", name}, {"model", name + "/model.json"}, {"recordings", files}, {"options", options}};
}

void write_all(const Arguments& a) {
  std::vector<json> items(static_cast<std::size_t>(a.benches));
  std::mutex mutex;  // over files and output
  model::inference::in_parallel(items.size(), a.jobs, [&](std::size_t i) {
    const int index = a.first + static_cast<int>(i);
    const auto begin = std::chrono::steady_clock::now();
    const auto bench = make_bench(a.seed, index, a.kind.value_or(kind_of(index)), a.bench);
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    items[i] = item_of(bench);
    const std::scoped_lock lock(mutex);
    write_bench(bench, a.write + "/" + name_of(bench.index));
    std::cout << line_of(bench, spent.count()) << std::endl;
  });
  std::ofstream manifest(a.write + "/manifest.json");
  manifest << json{{"items", items}}.dump(1) << '\n';
  if (!manifest.flush()) throw Error(ErrorCode::io_error, a.write + "/manifest.json cannot be written");
}

// Of each item, which its result does not hold.
std::map<std::string, double> seconds_of(const std::filesystem::path& batch) {
  std::map<std::string, double> out;
  for (const auto& log : std::filesystem::directory_iterator(batch / "log")) {
    std::ifstream in(log.path());
    for (std::string line; std::getline(in, line);) {
      const auto told = json::parse(line, nullptr, false);
      if (told.is_object() && told.contains("seconds")) out[told.at("item")] = told.at("seconds");
    }
  }
  return out;
}

std::vector<Outcome> judge_all(const Arguments& a) {
  const std::filesystem::path batch(a.judge);
  const auto seconds = seconds_of(batch);
  std::vector<std::filesystem::path> results;
  for (const auto& entry : std::filesystem::directory_iterator(batch / "items"))
    if (entry.path().extension() == ".json") results.push_back(entry.path());
  std::ranges::sort(results);
  std::vector<Outcome> out;
  for (const auto& file : results) {
    std::ifstream in(file);
    const auto result = json::parse(in);
    const std::string id = result.at("id");
    const auto bench = read_truth(a.read + "/" + id);
    out.push_back(result.at("state") == "done" ? score(bench, result.at("result"))
                                               : score_error(bench, result.at("error").at("message")));
    if (const auto spent = seconds.find(id); spent != seconds.end()) out.back().seconds = spent->second;
    std::cout << line_of(out.back()) << '\n';
  }
  std::cout << text_of(out);
  if (!a.json.empty()) std::ofstream(a.json) << json_of(out).dump(1) << '\n';
  return out;
}

}  // namespace
}  // namespace ferrobench::campaign

int main(int argc, char** argv) {
  using namespace ferrobench;
  try {
    if (argc < 2 || std::string_view(argv[1]) == "--help") {
      std::cout << campaign::usage;
      return 0;
    }
    const auto arguments = campaign::parse({argv, static_cast<std::size_t>(argc)});
    if (!arguments.write.empty()) {
      campaign::write_all(arguments);
      return 0;
    }
    if (!arguments.thresholds.empty()) {
      campaign::ask_with_other_thresholds({.benches = arguments.read,
                                           .log = arguments.thresholds,
                                           .first = arguments.first,
                                           .count = arguments.benches,
                                           .jobs = arguments.jobs,
                                           .only = arguments.only});
      std::cout << campaign::table_of_thresholds(arguments.thresholds);
      return 0;
    }
    const auto outcomes = campaign::judge_all(arguments);
    return arguments.strict && !std::ranges::all_of(outcomes, &campaign::Outcome::right) ? 2 : 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
