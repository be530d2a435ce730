// The command line. Each subcommand is one function that adds itself to the program; what it does runs after
// parsing and returns the exit code.
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "protocols/past.h"
#include "recordings/disk/new_file.h"

namespace ferrobench::cli {

enum ExitCode { exit_ok = 0, exit_error = 1, exit_usage = 2, exit_interrupted = 130 };

// What every subcommand shares.
struct Common {
  std::string data;             // --data; "": the default folder
  std::string socket;           // --socket; "": that of the data folder
  std::string lease;            // --lease; "": none
  std::function<int()> action;  // set by the subcommand that was chosen
  std::string data_folder() const;
  std::string socket_path() const;
};

void add_serve(CLI::App& app, Common& common);
void add_run(CLI::App& app, Common& common);
void add_replay(CLI::App& app, Common& common);
void add_rerun(CLI::App& app, Common& common);
void add_compare(CLI::App& app, Common& common);
void add_average(CLI::App& app, Common& common);
void add_list(CLI::App& app, Common& common);
void add_queue(CLI::App& app, Common& common);
void add_recover(CLI::App& app, Common& common);
void add_report(CLI::App& app, Common& common);
void add_table(CLI::App& app, Common& common);
void add_simulate(CLI::App& app, Common& common);
void add_fit(CLI::App& app, Common& common);
void add_discover(CLI::App& app, Common& common);
void add_protocol(CLI::App& app, Common& common);
void add_model(CLI::App& app, Common& common);
void add_effects(CLI::App& app, Common& common);
void add_call(CLI::App& app, Common& common);
void add_export(CLI::App& app, Common& common);
void add_import(CLI::App& app, Common& common);
void add_limits(CLI::App& app, Common& common);
void add_batch(CLI::App& app, Common& common);
void add_selftest(CLI::App& app, Common& common);

// Every option and subcommand: what --help, the manual page and the shell's completion are made from.
void build_program(CLI::App& app, Common& common);
// The whole program: parses, acts, prints errors to stderr.
int run_program(int argc, const char* const* argv);
// The program without an action, for its help.
std::string help_of(const std::vector<std::string>& arguments);

// Arguments that are read alike by several subcommands.
// A name of the library, or a file (.json, .csv) as its JSON.
nlohmann::json protocol_argument(const std::string& given);
// A name, or a file as its JSON; null if nothing was given.
nlohmann::json model_argument(const std::string& given);
// A kind of past by its name, or a past as JSON text; none if nothing was given. Error(invalid_params).
std::optional<protocols::Past> past_argument(const std::string& given);
// The option --past of a command that simulates.
CLI::Option* add_past(CLI::App* sub, std::string& past);
// "key=value" texts as an object; values are JSON where they parse as such. Error(invalid_params).
nlohmann::json set_argument(const std::vector<std::string>& settings);
// What is to be run, and on what: of 'run' and of 'queue add'.
struct RunChoice {
  std::string protocol{}, model{}, notes{};
  std::string device = "virtual", config{};
  bool fast = false;
  std::int64_t seed = 1;
  std::vector<std::string> set{};
};
nlohmann::json run_argument(const RunChoice& choice);  // the parameters of run.start
// The file of a recording: a path, or a name in the store. Error(not_found).
std::string recording_argument(const std::string& given, const Common& common);
// The names of recordings that all lie in the data folder, whichever way they were given; nothing if one does
// not.
std::optional<std::vector<std::string>> names_in_store(const std::vector<std::string>& given,
                                                       const Common& common);
// Where a command's text goes, asked before it works for it. Standard output if "", "-" or a name of it; a
// pipe or a terminal is written to; a file has its name when all of it is there, whatever had it before, but
// for the sources of the text. Errors as recordings::demand_place.
class TextOutput {
 public:
  explicit TextOutput(std::string file, const std::vector<std::string>& sources = {});
  void write(const std::string& text) const;

 private:
  enum class Kind { standard, stream, file };
  std::string file_;
  Kind kind_ = Kind::file;
};

// Asked before a recording is made: Error if it cannot be put there, or something is there that is not to be
// replaced. What it says is what the maker is to be told. Sources may be names that are no files.
recordings::Existing demand_free(const std::string& file, bool replace,
                                 const std::vector<std::string>& sources = {});

// Follows a run from its first status, with progress on stderr, until it is over; an interrupt asks for a
// safe stop. `ask` and `abort` are told the run's id. Returns the last status, with "interrupted".
nlohmann::json follow(nlohmann::json status, const std::function<nlohmann::json(const std::string& id)>& ask,
                      const std::function<void(const std::string& id, const std::string& reason)>& abort,
                      bool quiet);
// Says that the work was stopped with nothing to show for it; the exit code.
int tell_stopped();
// Says on stderr what went wrong, if anything did; the exit code.
int tell_end(const nlohmann::json& status);

// While it lives, Ctrl-C (and SIGTERM) only raises a flag.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  static int count();  // how often so far
};

// One line on a terminal, redrawn; elsewhere a line now and then, if it takes longer than a second. On
// stderr.
class ProgressLine {
 public:
  void show(const std::string& state, double progress, double seconds_left);
  void finish();

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  bool open_ = false;
  int last_tenth_ = -1;
  std::string last_state_;
};

}  // namespace ferrobench::cli
