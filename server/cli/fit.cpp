#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <iostream>
#include <utility>

#include "base/number_text.h"
#include "base/visible.h"
#include "recordings/file/reader.h"
#include "server/cli/link.h"
#include "server/cli/words.h"
#include "server/engine/fitting.h"

namespace ferrobench::cli {

using nlohmann::json;

namespace {

struct FitOptions {
  server::FitRequest request;
  std::vector<std::string> recordings, set;
  std::string model, out, report;
};

// Pairs of parameters whose errors go together so closely that the data hardly tell them apart.
void print_correlations(const json& result) {
  constexpr double close = 0.95;
  const auto& names = result.at("parameters");
  bool first = true;
  for (std::size_t i = 0; result.contains("correlations") && i < names.size(); ++i)
    for (std::size_t k = i + 1; k < names.size(); ++k) {
      const double r = result.at("correlations").at(i).at(k).get<double>();
      if (std::abs(r) < close) continue;
      std::printf("%s%s and %s: correlation %.3f\n", std::exchange(first, false) ? "\n" : "",
                  names.at(i).at("path").get<std::string>().c_str(),
                  names.at(k).at("path").get<std::string>().c_str(), r);
    }
}

protocols::Past past_of(json entry) {
  entry.erase("recording");
  entry.erase("chosen");
  return protocols::past_from_json(entry, ErrorCode::internal);
}

void print_result(const json& result) {
  if (!result.contains("parameters")) return;
  if (result.contains("verdict"))
    std::printf("%s\n\n", visible(result.at("verdict").at("text").get<std::string>()).c_str());
  std::printf("%-38s %11s %11s   %-23s %s\n", "parameter", "from", "to", "95 % interval", "");
  for (const auto& p : result.at("parameters")) {
    std::string interval, remark;
    if (p.contains("interval")) {
      const auto& ends = p.at("interval");
      const auto [low, high] = interval_text(ends.at(0).get<double>(), ends.at(1).get<double>());
      interval = fmt::format("{} to {}", low, high);
    }
    if (p.at("at_bound").get<bool>())
      remark = fmt::format("AT ITS BOUND ({:.3g} to {:.3g})", p.at("low").get<double>(),
                           p.at("high").get<double>());
    else if (!p.value("determined", true))
      remark = "not determined";
    std::printf("%-38s %11.5g %11.5g   %-23s %s\n", p.at("path").get<std::string>().c_str(),
                p.at("from").get<double>(), p.at("to").get<double>(), interval.c_str(), remark.c_str());
  }
  print_correlations(result);
  const bool has_rms = !result.at("after").empty();  // not of a fit that was stopped before its end
  std::printf("\n%-44s %12s %12s\n", has_rms ? "root mean square" : "", "before", "after");
  for (const auto& [name, value] : result.at("after").items())
    std::printf("%-44s %12.5g %12.5g\n", name.c_str(), result.at("before").at(name).get<double>(),
                value.get<double>());
  std::printf("%-44s %12.5g %12.5g   after %d simulations%s\n", "sum of squares",
              result.at("cost_before").get<double>(), result.at("cost_after").get<double>(),
              result.at("simulations").get<int>(),
              result.at("stopped").get<bool>() ? ", stopped: the best so far" : "");
  for (const auto& past : result.at("pasts"))
    if (past.at("chosen").get<bool>())
      std::printf("before %s the specimen was likeliest %s\n",
                  visible(past.at("recording").get<std::string>()).c_str(), in_words(past_of(past)).c_str());
  for (const auto& sentence : result.at("unused"))
    std::printf("not used: %s\n", sentence.get<std::string>().c_str());
}

// Of files, in this process: no daemon reads a file by its path.
json fit_here(const FitOptions& o, const Common& common) {
  const auto start = model::model_from_json(
      server::resolve_model(model_argument(o.model), server::Store(common.data_folder())));
  std::vector<recordings::Recording> recordings;
  for (const auto& name : o.recordings)
    recordings.push_back(recordings::read_recording(recording_argument(name, common)));

  const Interrupt interrupt;
  ProgressLine line;
  const auto begin = std::chrono::steady_clock::now();
  auto result = server::fit_model(
      o.request, start, std::move(recordings),
      [&](const model::FitProgress& p) {
        const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
        const double left = p.fraction > 0 ? spent.count() * (1 - p.fraction) / p.fraction : -1;
        line.show(p.stage, p.fraction, left);
        return Interrupt::count() == 0;
      },
      [] { return Interrupt::count() > 0; });
  line.finish();
  return result;
}

int fit(FitOptions o, const Common& common) {
  std::vector<std::string> sources{o.model};
  for (const auto& given : o.recordings) sources.push_back(recording_argument(given, common));
  const TextOutput out(o.out, sources), report(o.report, sources);
  if (!o.report.empty() && o.request.calibrate)
    throw Error(ErrorCode::invalid_params, "a calibration fits nothing, so there is no page about it",
                Problem{.path = "/report", .message = "does not go with --calibrate"});
  o.request.report = !o.report.empty();
  o.request.set = set_argument(o.set);
  const auto names = names_in_store(o.recordings, common);
  auto daemon = names ? running_daemon(common) : std::nullopt;
  json result;
  if (daemon) {
    auto params = write_json(o.request);
    params["recordings"] = *names;
    params["model"] = model_argument(o.model);
    result = carry_out_job(*daemon, "model.fit", params).at("result");
    if (result.is_null()) return tell_stopped();
  } else {
    result = fit_here(o, common);
  }
  print_result(result);
  out.write(result.at("model").dump(2) + "\n");
  if (result.contains("html")) report.write(result.at("html").get<std::string>());
  return result.value("stopped", false) ? exit_interrupted : exit_ok;
}

}  // namespace

void add_fit(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("fit", "Fit a model to published tables or to recordings, or calibrate it");
  auto o = std::make_shared<FitOptions>();
  const auto list = [](CLI::Option* option) {
    return option->expected(1)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  };
  sub->add_option("RECORDING", o->recordings, "files, or names in the data folder");
  list(sub->add_option(
           "--table", o->request.tables,
           "a published table; again for more, fitted together, by the simulation of 'ferrobench table'"))
      ->type_name("TABLE");
  sub->add_flag("--calibrate", o->request.calibrate,
                "take the critical force of the parametrized polycrystal from one slow loop, or from two at "
                "different prestress");
  sub->add_option("--model", o->model, "to start from, by name or file")->required();
  list(sub->add_option("--set", o->set, "a parameter of the tables' protocols, for example rate=10"))
      ->type_name("KEY=VALUE");
  list(sub->add_option(
           "--free", o->request.free,
           "a parameter that moves, for example material.barrier; again for more; default: the usual ones"))
      ->type_name("PATH");
  sub->add_option("--starts", o->request.starts,
                  "the first is the model given, each of the others comes from a global search")
      ->check(number_from(1, 1000))
      ->capture_default_str();
  sub->add_option("--iterations", o->request.iterations, "of each least-squares solution, at most")
      ->check(number_from(1, 10000))
      ->capture_default_str();
  sub->add_option("--seed", o->request.seed, "of the global searches")
      ->check(number_from(0))
      ->capture_default_str();
  sub->add_option("--out", o->out, "file of the fitted model")->type_name("OUT.json")->required();
  sub->add_option("--report", o->report, "file of a page with pictures, intervals and correlations")
      ->type_name("PAGE.html");
  sub->footer(
      "A recording that does not say what its specimen had been through gets the likeliest past, and the\n"
      "result says which.\n"
      "Ctrl-C ends with the best so far. While a daemon runs, recordings of the data folder and tables are "
      "its\n"
      "job, which goes on if this command is killed (job.list); files from elsewhere are fitted by the "
      "command.\n"
      "Examples:\n"
      "  ferrobench fit --table 3.11 --table 3.12 --model soft-pzt --out nec.json\n"
      "  ferrobench fit creep.h5 loops.h5 --model nec-ae0505d08 --out mine.json --report fit.html\n"
      "  ferrobench fit --calibrate slow-loop.h5 --model nec-ae0505d08 --out parametrized.json");
  sub->callback([o, &common] { common.action = [o, &common] { return fit(*o, common); }; });
}

}  // namespace ferrobench::cli
