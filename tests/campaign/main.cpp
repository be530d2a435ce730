// ferrobench_campaign: simulated benches, the workflow run on each, and what came out.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <csignal>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <mutex>
#include <optional>
#include <sstream>
#include <thread>

#include "tests/campaign/table.h"

namespace ferrobench::campaign {
namespace {

constexpr std::string_view usage =
    "ferrobench_campaign [--benches N] [--seed S] [--kind K] [--first I] [--jobs J] [--commanded SHARE] "
    "[--vary V,V] [--json OUT] [--write FOLDER | --read FOLDER] [--strict yes]\n"
    "  --kind   single | pair | nothing | moved | outside | withheld | coloured | physics; without it a\n"
    "           mixture of all but the last\n"
    "  --first  index of the first bench\n"
    "  --jobs   benches at a time, which share the cores (1)\n"
    "  --commanded  share of the benches whose recordings hold the command (0.85); where the drive is at "
    "fault\n"
    "           they always do\n"
    "  --vary   any of low_noise,few_recordings,past,charge_only\n"
    "  --json   the answers; those that OUT holds already are kept and not asked for again\n"
    "  --write  write the benches (model.json, truth.json, *.h5) into FOLDER/bench-NNN and run nothing\n"
    "  --read   take the benches from there\n"
    "  --strict yes: exit code 2 unless every answer is right\n";

struct Arguments {
  int benches = 25, first = 0, jobs = 1;
  std::uint64_t seed = 1;
  std::optional<Kind> kind;
  BenchOptions bench{};
  std::string write, read, json;
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

void vary(BenchOptions& bench, const std::string& what) {
  const std::map<std::string, bool*> places{{"low_noise", &bench.low_noise},
                                            {"few_recordings", &bench.few_recordings},
                                            {"past", &bench.past},
                                            {"charge_only", &bench.charge_only}};
  std::istringstream words(what);
  for (std::string word; std::getline(words, word, ',');) {
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
      throw Error(ErrorCode::invalid_params, name + " needs a value\n" + std::string(usage));
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
    } else if (name == "--read") {
      a.read = value;
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
      throw Error(ErrorCode::invalid_params, name + " is not known\n" + std::string(usage));
    }
  }
  return a;
}

std::string folder_of(const std::string& parent, int index) {
  return fmt::format("{}/bench-{:03}", parent, index);
}

void write_all(const Arguments& a) {
  for (int i = a.first; i < a.first + a.benches; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    const auto bench = make_bench(a.seed, i, a.kind.value_or(kind_of(i)), a.bench);
    const auto folder = folder_of(a.write, i);
    write_bench(bench, folder);
    const auto truth = truth_of(bench);
    std::size_t samples = 0;
    for (const auto& r : bench.recordings) samples += r.recording.size();
    std::string effects;
    for (const auto& e : truth["effects"])
      effects += " " + e["id"].get<std::string>() + " " + e["parameters"].dump() + " size " +
                 std::to_string(e["size"].get<double>());
    for (const auto& p : truth["physics"]) effects += " with " + p.dump();
    if (bench.left > 0) effects += " that leave " + std::to_string(bench.left);
    std::cout << folder << ' ' << truth["kind"].get<std::string>() << effects << ", " << samples
              << " samples, "
              << std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() << " s\n"
              << std::flush;
  }
}

volatile std::sig_atomic_t interrupted = 0;

Outcome answer(const Bench& bench, int threads) {
  model::DiscoverOptions options;
  options.candidates = bench.candidates;
  options.seed = bench.seed;
  options.threads = threads;
  options.progress = [](const model::DiscoverProgress&) { return interrupted == 0; };
  try {
    return score(bench, model::discover(bench.handed, bench.recordings, options));
  } catch (const Error& error) {
    if (error.code() == ErrorCode::cancelled) throw;
    return score_error(bench, error.what());
  }
}

std::map<int, Outcome> answered(const Arguments& a) {
  std::map<int, Outcome> out;
  std::ifstream file(a.json);
  if (a.json.empty() || !file) return out;
  const auto json = nlohmann::json::parse(file);
  if (json.at("seed") != a.seed) throw bad("--json", a.json, "a file of the same seed, or a new one");
  for (const auto& o : json.at("benches")) out.emplace(o.at("index"), outcome_from_json(o));
  return out;
}

// Until done, or until Ctrl-C: then with what there is so far.
std::vector<Outcome> run_all(const Arguments& a) {
  (void)std::signal(SIGINT, [](int) { interrupted = 1; });
  auto outcomes = answered(a);
  const auto all = [&] {
    std::vector<Outcome> out;
    out.reserve(outcomes.size());
    for (const auto& [index, outcome] : outcomes) out.push_back(outcome);
    return out;
  };
  std::mutex mutex;
  std::atomic<int> next = a.first;
  std::exception_ptr failure;
  const int threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / a.jobs);
  const auto work = [&] {
    for (int i = next++; i < a.first + a.benches && interrupted == 0; i = next++) {
      {
        const std::scoped_lock lock(mutex);
        if (outcomes.contains(i)) continue;
      }
      try {
        const auto outcome =
            answer(a.read.empty() ? make_bench(a.seed, i, a.kind.value_or(kind_of(i)), a.bench)
                                  : read_bench(folder_of(a.read, i)),
                   threads);
        const std::scoped_lock lock(mutex);
        outcomes.emplace(i, outcome);
        std::cout << line_of(outcome) << std::endl;
        if (a.json.empty()) continue;
        auto json = json_of(all());
        json["seed"] = a.seed;
        std::ofstream(a.json + ".new") << json.dump(1) << '\n';
        std::filesystem::rename(a.json + ".new", a.json);
      } catch (...) {
        const std::scoped_lock lock(mutex);
        if (interrupted == 0) failure = std::current_exception();
        interrupted = 1;
      }
    }
  };
  {
    std::vector<std::jthread> others;
    for (int job = 1; job < a.jobs; ++job) others.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
  std::cout << text_of(all());
  return all();
}

}  // namespace
}  // namespace ferrobench::campaign

int main(int argc, char** argv) {
  using namespace ferrobench;
  try {
    const auto arguments = campaign::parse({argv, static_cast<std::size_t>(argc)});
    if (!arguments.write.empty()) {
      campaign::write_all(arguments);
      return 0;
    }
    const auto outcomes = campaign::run_all(arguments);
    return arguments.strict && !std::ranges::all_of(outcomes, &campaign::Outcome::right) ? 2 : 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
