// ferrobench_campaign: simulated benches, the workflow run on each, and what came out.
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <optional>

#include "tests/campaign/table.h"

namespace ferrobench::campaign {
namespace {

constexpr std::string_view usage =
    "ferrobench_campaign [--benches N] [--seed S] [--kind K] [--first I] [--threads T] [--write FOLDER] "
    "[--json OUT]\n"
    "  --kind   single | pair | nothing | moved | outside | withheld | coloured; without it a mixture\n"
    "  --first  index of the first bench\n"
    "  --write  write the benches (model.json, truth.json, *.h5) into FOLDER/bench-NNN and run nothing\n";

struct Arguments {
  int benches = 25, first = 0, threads = 0;
  std::uint64_t seed = 1;
  std::optional<Kind> kind;
  std::string write, json;
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
    } else if (name == "--threads") {
      a.threads = number<int>(name, value);
    } else if (name == "--write") {
      a.write = value;
    } else if (name == "--json") {
      a.json = value;
    } else if (name == "--kind") {
      for (const auto& [kind, text] : enum_names(Kind{}))
        if (text == value) a.kind = kind;
      if (!a.kind) throw bad(name, value, "one of those below\n" + std::string(usage));
    } else {
      throw Error(ErrorCode::invalid_params, name + " is not known\n" + std::string(usage));
    }
  }
  return a;
}

void write_all(const Arguments& a) {
  for (int i = a.first; i < a.first + a.benches; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    const auto bench = make_bench(a.seed, i, a.kind.value_or(kind_of(i)));
    char name[32];
    std::snprintf(name, sizeof name, "/bench-%03d", i);
    write_bench(bench, a.write + name);
    const auto truth = truth_of(bench);
    std::size_t samples = 0;
    for (const auto& r : bench.recordings) samples += r.recording.size();
    std::string effects;
    for (const auto& e : truth["effects"])
      effects += " " + e["id"].get<std::string>() + " " + e["parameters"].dump() + " size " +
                 std::to_string(e["size"].get<double>());
    std::cout << name + 1 << ' ' << truth["kind"].get<std::string>() << effects << ", " << samples
              << " samples, "
              << std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() << " s\n"
              << std::flush;
  }
}

volatile std::sig_atomic_t interrupted = 0;

// Until done, or until Ctrl-C: then with what there is so far.
void run_all(const Arguments& a) {
  std::signal(SIGINT, [](int) { interrupted = 1; });
  std::vector<Outcome> outcomes;
  for (int i = a.first; i < a.first + a.benches && interrupted == 0; ++i) {
    const auto bench = make_bench(a.seed, i, a.kind.value_or(kind_of(i)));
    model::DiscoverOptions options;
    options.candidates = bench.candidates;
    options.seed = a.seed;
    options.threads = a.threads;
    options.progress = [](const model::DiscoverProgress&) { return interrupted == 0; };
    try {
      outcomes.push_back(score(bench, model::discover(bench.handed, bench.recordings, options)));
    } catch (const Error& error) {
      if (error.code() == ErrorCode::cancelled) break;
      outcomes.push_back(score_error(bench, error.what()));
    }
    std::cout << line_of(outcomes.back()) << std::endl;
    if (!a.json.empty()) {
      auto json = json_of(outcomes);
      json["seed"] = a.seed;
      std::ofstream(a.json) << json.dump(1) << '\n';
    }
  }
  std::cout << text_of(outcomes);
}

}  // namespace
}  // namespace ferrobench::campaign

int main(int argc, char** argv) {
  using namespace ferrobench;
  try {
    const auto arguments = campaign::parse({argv, static_cast<std::size_t>(argc)});
    arguments.write.empty() ? campaign::run_all(arguments) : campaign::write_all(arguments);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
