#include <cstdio>
#include <iostream>

#include "base/text_file.h"
#include "base/visible.h"
#include "server/cli/link.h"
#include "server/cli/words.h"

namespace ferrobench::cli {

using nlohmann::json;

namespace {

struct QueueOptions : RunChoice {
  std::string plan_file{}, name{};
  bool shuffle = false, automatic = false;
  std::int64_t repeats = 1, repeat_broken = 0, stop_after_failures = 1;
  std::vector<std::string> sweeps{};
  std::string wait{};
  std::int64_t item = 0, plan = 0, before = 0, first = 0, count = 100;
  bool to_front = false;
  std::string state{}, format = "text", of = "mean", out{};
  std::vector<std::string> figures{};
};

constexpr std::size_t most_plan_bytes = 4u << 20;  // as the daemon takes

std::vector<std::string> split(const std::string& text, char by) {
  std::vector<std::string> out;
  for (std::size_t at = 0; at <= text.size();) {
    const auto end = std::min(text.find(by, at), text.size());
    out.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return out;
}

json value_in(const std::string& text) {
  auto value = json::parse(text, nullptr, false);
  return value.is_discarded() ? json(text) : value;
}

// "rate=1,2,5", "rate=0.1:10:5", "rate=0.1:10:5:logarithmic"
json sweep_argument(const std::string& text) {
  const auto equals = text.find('=');
  if (equals == 0 || equals == std::string::npos)
    throw Error(ErrorCode::invalid_params, "a sweep is KEY=VALUES",
                Problem{.path = "/sweep",
                        .given = excerpt(text),
                        .hint = "for example --sweep rate=1,2,5 or --sweep rate=0.1:10:5:logarithmic"});
  json sweep{{"set", text.substr(0, equals)}};
  const auto values = text.substr(equals + 1);
  const auto range = split(values, ':');
  if (range.size() == 3 || range.size() == 4) {
    for (std::size_t i = 0; i < 3; ++i) sweep[std::array{"from", "to", "count"}.at(i)] = value_in(range[i]);
    if (range.size() == 4) sweep["spacing"] = range[3] == "log" ? "logarithmic" : range[3];
    return sweep;
  }
  if (range.size() > 1)
    throw Error(ErrorCode::invalid_params, "a sweep over a range is KEY=FROM:TO:COUNT",
                Problem{.path = "/sweep",
                        .message = range.size() == 2 ? "has no count" : "has too many parts",
                        .given = excerpt(text),
                        .hint = "for example --sweep rate=1:100:5 or --sweep rate=1:100:5:logarithmic"});
  sweep["values"] = json::array();
  for (const auto& value : split(values, ',')) sweep["values"].push_back(value_in(value));
  return sweep;
}

// "force=98:2:N:10:600"
json wait_argument(const std::string& text) {
  const auto equals = std::min(text.find('='), text.size());
  const auto parts = split(text.substr(std::min(equals + 1, text.size())), ':');
  if (equals == text.size() || parts.size() != 5)
    throw Error(ErrorCode::invalid_params, "a wait is CHANNEL=VALUE:TOLERANCE:UNIT:SECONDS:MOST_SECONDS",
                Problem{.path = "/wait",
                        .given = excerpt(text),
                        .hint = "for example --wait force=98:2:N:10:600, which is: until the force has been "
                                "within 2 N of 98 N for 10 s, but no more than 600 s"});
  return {{"channel", text.substr(0, equals)}, {"value", value_in(parts[0])},
          {"tolerance", value_in(parts[1])},   {"unit", parts[2]},
          {"for_s", value_in(parts[3])},       {"timeout_s", value_in(parts[4])}};
}

json plan_argument(const QueueOptions& o) {
  if (!o.plan_file.empty())
    return parse_json_text(read_text_file(o.plan_file, most_plan_bytes, ErrorCode::invalid_params),
                           ErrorCode::invalid_params, o.plan_file);
  json plan{{"name", o.name},
            {"run", run_argument(o)},
            {"sweeps", json::array()},
            {"repeats", o.repeats},
            {"shuffle", o.shuffle},
            {"seed", o.seed},
            {"resume", o.automatic ? "automatic" : "operator"},
            {"repeat_broken", o.repeat_broken},
            {"stop_after_failures", o.stop_after_failures}};
  if (!o.wait.empty()) plan["wait"] = wait_argument(o.wait);
  for (const auto& sweep : o.sweeps) plan["sweeps"].push_back(sweep_argument(sweep));
  return plan;
}

// Problems lead to what was typed, where a plan was made of it.
int add_to_queue(const QueueOptions& o, const Common& common) {
  const auto plan = plan_argument(o);
  json added;
  try {
    added = Link(common).call("queue.add", {{"plan", plan}});
  } catch (const Error& refused) {
    auto problems = refused.problems();
    for (auto& p : problems) {
      for (const std::string part : {"/plan", "/run", "/protocol", "/model"}) {
        const bool within = part == "/plan" || part == "/run" || refused.code() != ErrorCode::invalid_params;
        if (o.plan_file.empty() && within && p.path.starts_with(part + "/")) p.path.erase(0, part.size());
      }
      if (!o.plan_file.empty() && p.path.starts_with("/plan")) p.path = o.plan_file + ": " + p.path.substr(5);
    }
    throw Error(refused.code(), refused.message(), std::move(problems));
  }
  std::printf("plan %lld: %lld run%s from item %lld on\n",
              static_cast<long long>(added.at("plan").get<std::int64_t>()),
              static_cast<long long>(added.at("count").get<std::int64_t>()),
              added.at("count") == 1 ? "" : "s",
              static_cast<long long>(added.at("first_item").get<std::int64_t>()));
  return exit_ok;
}

int tell_queue(const json& status) {
  const auto state = status.at("state").get<std::string>();
  std::string text = "the queue is " + state;
  if (state == "running") text += ": item " + status.at("item").dump();
  if (state == "waits") text = "the queue waits";
  if (state == "asks")
    text = "the queue waits for you: " + status.at("confirm").get<std::string>() +
           "; then 'ferrobench queue confirm " + status.at("item").dump() + "'";
  if (const auto reason = text_at(status, "reason"); !reason.empty()) text += ": " + reason;
  if (state == "stopped" && status.at("item") != 0)
    text += "; item " + status.at("item").dump() + " is still under way";
  std::cout << visible(text) << '\n';
  return exit_ok;
}

std::string what_of(const json& item) {
  std::string out = item.at("name").get<std::string>();
  for (const auto& [key, value] : item.at("values").items()) out += "  " + key + "=" + value.dump();
  if (item.at("repeat") != 1) out += "  repeat " + item.at("repeat").dump();
  return visible(out);
}

int list_queue(const QueueOptions& o, const Common& common) {
  json params{{"first", o.first}, {"count", o.count}, {"plan", o.plan}};
  if (!o.state.empty()) params["state"] = o.state;
  const auto listed = Link(common).call("queue.list", params);
  if (o.format == "json") {
    std::cout << listed.dump(2) << '\n';
    return exit_ok;
  }
  tell_queue(listed.at("queue"));
  for (const auto& item : listed.at("items")) {
    auto end = item.at("reason").get<std::string>();
    if (end.empty()) end = item.at("recording").get<std::string>();
    std::printf("%6s  plan %-4s %-10s  %s  %s\n", item.at("item").dump().c_str(),
                item.at("plan").dump().c_str(), item.at("state").get<std::string>().c_str(),
                what_of(item).c_str(), visible(end).c_str());
  }
  const auto shown = listed.at("items").size(), total = listed.at("total").get<std::size_t>();
  if (shown < total) std::printf("%zu of %zu; --first and --count show others\n", shown, total);
  return exit_ok;
}

json choice_of(const QueueOptions& o) {
  json params = json::object();
  if (o.item != 0) params["item"] = o.item;
  if (o.plan != 0) params["plan"] = o.plan;
  return params;
}

int say_count(const json& changed, const char* what) {
  std::cout << changed.at("count") << ' ' << what << '\n';
  return exit_ok;
}

int move_in_queue(const QueueOptions& o, const Common& common) {
  auto params = choice_of(o);
  if (o.before != 0) params["before"] = o.before;
  params["first"] = o.to_front;
  return say_count(Link(common).call("queue.move", params), "moved");
}

int summarize_plan(const QueueOptions& o, const Common& common) {
  const TextOutput out(o.out);
  const json params{{"plan", o.plan}, {"figures", o.figures}, {"of", o.of}, {"format", o.format}};
  const auto summary = Link(common).call("queue.summary", params);
  out.write(o.format == "json" ? summary.dump(2) + "\n" : summary.at("content").get<std::string>());
  return exit_ok;
}

void add_choice(CLI::App* sub, QueueOptions& o) {
  auto* item = sub->add_option("ITEM", o.item, "as 'queue list' numbers them")->check(number_from(1));
  sub->add_option("--plan", o.plan, "all items of this plan")->check(number_from(1))->excludes(item);
}

using Act = int (*)(const QueueOptions&, const Common&);

CLI::App* add_verb(CLI::App* queue, const char* name, const char* what,
                   const std::shared_ptr<QueueOptions>& o, Common& common, Act act) {
  auto* sub = queue->add_subcommand(name, what);
  sub->callback([o, act, &common] { common.action = [o, act, &common] { return act(*o, common); }; });
  return sub;
}

void add_queue_add(CLI::App* queue, const std::shared_ptr<QueueOptions>& o, Common& common) {
  auto* sub =
      add_verb(queue, "add", "Put a run, or a run over lists of values, at its end", o, common, add_to_queue);
  auto* protocol = sub->add_option("PROTOCOL", o->protocol, "name of a protocol, or a file, as for 'run'");
  sub->add_option("--plan-file", o->plan_file, "a plan, in place of all else")
      ->type_name("FILE.json")
      ->excludes(protocol);
  sub->add_option(
         "--sweep", o->sweeps,
         "a setting and its values, KEY=V1,V2,... or KEY=FROM:TO:COUNT[:logarithmic]; again for more")
      ->type_name("KEY=VALUES")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--wait", o->wait,
                  "what is waited for at zero field before each run, "
                  "CHANNEL=VALUE:TOLERANCE:UNIT:SECONDS:MOST_SECONDS: "
                  "the channel (field, charge, displacement or force) has been that near to the value for so "
                  "long; a run that has waited longest in vain has failed")
      ->type_name("CONDITION");
  sub->add_option("--repeats", o->repeats, "of each combination")
      ->check(number_from(1))
      ->capture_default_str();
  sub->add_flag("--shuffle", o->shuffle, "in a random order, the same for the same seed");
  sub->add_option("--name", o->name, "of the plan; default: that of the protocol");
  sub->add_option("--set", o->set, "as for 'run'")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--device", o->device, "as for 'run'")->capture_default_str();
  sub->add_option("--device-config", o->config, "what the device is and what is wired to it")
      ->type_name("FILE.json");
  sub->add_option("--model", o->model, "virtual device: model by name or file");
  sub->add_flag("--fast", o->fast, "virtual device and replay: as fast as it can go");
  sub->add_option("--seed", o->seed, "of the order, and of the first run's noise on the virtual device")
      ->check(number_from(0))
      ->capture_default_str();
  sub->add_option("--notes", o->notes, "kept in each recording");
  sub->add_option("--repeat-broken", o->repeat_broken,
                  "how often a run is repeated that broke off as a process or the machine died")
      ->check(number_from(0, 1000))
      ->capture_default_str();
  sub->add_option("--stop-after-failures", o->stop_after_failures,
                  "the queue stops after so many failed runs of the plan; 0: never")
      ->check(number_from(0))
      ->capture_default_str();
  sub->add_flag("--resume", o->automatic, "after a restart of the daemon it goes on by itself");
  sub->footer(
      "Nothing starts before 'queue start'. What is added is checked at once, and run as it is now.\n"
      "Examples:\n"
      "  ferrobench queue add full-loops --fast\n"
      "  ferrobench queue add full-loops --fast --sweep rate=1:100:5:logarithmic --sweep prestress_MPa=2,4,8 "
      "--repeats 2\n"
      "  ferrobench queue add full-loops --wait force=98:2:N:10:600\n"
      "  ferrobench queue add --plan-file night.json");
}

}  // namespace

void add_queue(CLI::App& app, Common& common) {
  auto* queue = app.add_subcommand("queue", "Runs one after the other, over a night and over restarts");
  queue->require_subcommand(1);
  queue->footer(
      "The daemon runs it; what is in it stands in queue.db of the data folder. 'call run.abort' stops the "
      "run under way\n"
      "and the queue with it.\n"
      "Examples:\n"
      "  ferrobench queue add creep-6-holds-fast --fast --sweep prestress_MPa=2,4,8\n"
      "  ferrobench queue start\n"
      "  ferrobench queue list");
  auto o = std::make_shared<QueueOptions>();
  add_queue_add(queue, o, common);
  auto* list = add_verb(queue, "list", "What it does, what waits and what is over", o, common, list_queue);
  list->add_option("--first", o->first, "how many to leave out at the beginning")->check(number_from(0));
  list->add_option("--count", o->count, "how many at most")
      ->check(number_from(0, 1000))
      ->capture_default_str();
  list->add_option("--plan", o->plan, "of this plan alone")->check(number_from(1));
  list->add_option("--state", o->state, "in this state alone")
      ->check(one_of({"waiting", "running", "complete", "aborted", "failed", "broken_off"}));
  list->add_option("--format", o->format, "text or json")
      ->check(one_of({"text", "json"}))
      ->capture_default_str();
  auto* move = add_verb(queue, "move", "Move what waits: before another item, to the front, or to the end", o,
                        common, move_in_queue);
  add_choice(move, *o);
  auto* before = move->add_option("--before", o->before, "another item that waits")->check(number_from(1));
  move->add_flag("--first", o->to_front, "before all others that wait")->excludes(before);
  add_choice(add_verb(queue, "remove", "Forget items; their recordings stay", o, common,
                      [](const QueueOptions& opt, const Common& c) {
                        return say_count(Link(c).call("queue.remove", choice_of(opt)), "removed");
                      }),
             *o);
  add_verb(queue, "start", "Run what waits, one after the other", o, common,
           [](const QueueOptions&, const Common& c) { return tell_queue(Link(c).call("queue.start")); });
  add_verb(queue, "stop", "Begin no further run; the one under way goes on", o, common,
           [](const QueueOptions&, const Common& c) { return tell_queue(Link(c).call("queue.stop")); });
  auto* summary = add_verb(queue, "summary", "Figures of a plan's recordings against what was swept", o,
                           common, summarize_plan);
  summary->add_option("PLAN", o->plan, "as 'queue list' numbers them")->required()->check(number_from(1));
  summary
      ->add_option(
          "--figure", o->figures,
          "TABLE.COLUMN of the report, for example stroke.stroke_um; again for more; default: strokes and "
          "hysteresis")
      ->type_name("FIGURE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  summary->add_option("--of", o->of, "what is taken of a report's rows, cycle by cycle")
      ->check(one_of({"mean", "first", "last", "min", "max"}))
      ->capture_default_str();
  summary->add_option("--format", o->format, "html has a picture")
      ->check(one_of({"text", "md", "csv", "json", "html"}))
      ->capture_default_str();
  summary->add_option("--out", o->out, "file; default: standard output")->type_name("FILE");
  add_verb(queue, "confirm", "Say that what it asks for is done", o, common,
           [](const QueueOptions& opt, const Common& c) {
             return tell_queue(Link(c).call("queue.confirm", {{"item", opt.item}}));
           })
      ->add_option("ITEM", o->item, "that asks")
      ->required()
      ->check(number_from(1));
}

}  // namespace ferrobench::cli
