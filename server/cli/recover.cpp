#include "recordings/file/recover.h"

#include <cstdio>
#include <filesystem>
#include <iostream>

#include "base/visible.h"
#include "recordings/disk/new_file.h"
#include "server/cli/link.h"

namespace ferrobench::cli {

namespace fs = std::filesystem;

namespace {

// A folder's broken ones, or the one that was named: a file, a journal, or a name in the data folder.
std::vector<std::string> chosen(const std::string& given, const Common& common) {
  const server::Store store(common.data_folder());
  std::error_code failure;
  if (given.empty() || fs::is_directory(given, failure)) {
    const auto folder = given.empty() ? store.folder().string() : given;
    recordings::remove_leftovers(folder);
    return recordings::find_broken(folder);
  }
  const bool is_file = fs::exists(given, failure) || fs::exists(recordings::present_file(given), failure);
  return {is_file || given.find('/') != std::string::npos ? given : store.recording(given).string()};
}

int recover(const std::string& given, const Common& common) {
  const auto paths = chosen(given, common);
  if (paths.empty()) std::cerr << "nothing to recover: no run has broken off\n";
  int code = exit_ok;
  for (const auto& path : paths) {
    ProgressLine line;
    try {
      const auto done = recordings::recover_recording(path, [&](double share) {
        line.show("recovering " + fs::path(path).filename().string(), share, -1);
      });
      line.finish();
      std::cout << recovered_name(done.outcome) << ' ' << visible(done.path) << ": " << visible(done.message)
                << '\n';
    } catch (const Error& error) {
      line.finish();
      std::cerr << "ferrobench: " << visible(path) << ": " << error.what() << '\n';
      code = exit_error;
    }
  }
  return code;
}

}  // namespace

void add_recover(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("recover",
                                 "Make the files of runs that broke off: a crash, a full disk, a power cut");
  auto given = std::make_shared<std::string>();
  sub->add_option(
      "PATH", *given,
      "a recording or its journal (NAME.h5.journal), its name in the data folder, or a folder and all in "
      "it; default: the data folder");
  sub->footer(
      "What had been recorded becomes the file, with status recovered and an event that states the gap; then "
      "the\n"
      "journal is removed. A run under way is left alone. It can be repeated and broken off without harm.\n"
      "Prints for each: recovered, completed (nothing was missing), already_whole, nothing (no sample had "
      "been\n"
      "recorded) or running.\n"
      "Examples:\n"
      "  ferrobench recover\n"
      "  ferrobench recover creep.h5\n"
      "  ferrobench recover /media/stick/recordings");
  sub->callback([given, &common] { common.action = [given, &common] { return recover(*given, common); }; });
}

}  // namespace ferrobench::cli
