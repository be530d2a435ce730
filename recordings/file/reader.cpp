#include "recordings/file/reader.h"

#include <algorithm>
#include <filesystem>

#include "base/error.h"
#include "recordings/format/sound.h"
#include "recordings/hdf5/read_apart.h"
#include "recordings/journal/reader.h"
#include "recordings/journal/writer.h"

namespace ferrobench::recordings {
namespace {

// A journal, or that of a file that is not there yet; none where it is the file that is to be read. A run
// that ends in between has its file then.
template <class Read>
auto from_journal(const std::string& path, Read&& read) -> std::optional<decltype(read(path))> {
  if (is_journal(path)) return read(path);
  if (std::filesystem::exists(path)) return std::nullopt;
  try {
    return read(journal_path(path));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::not_found) throw;
    return std::nullopt;
  }
}

}  // namespace

Recording read_recording(const std::string& path) {
  return read_recording(path, memory_for_each_recording());
}

Recording read_recording(const std::string& path, double most_bytes) {
  auto out = from_journal(path, [most_bytes](const std::string& journal) {
    // Its samples lie there as they do in memory.
    std::error_code failure;
    const auto bytes = static_cast<double>(std::filesystem::file_size(journal, failure));
    if (!failure && bytes > most_bytes)
      throw Error(ErrorCode::bad_recording, "the journal is too long to be read here",
                  Problem{.message = "takes as much memory as it has bytes",
                          .given = bytes,
                          .allowed = {{"to", most_bytes}},
                          .unit = "B",
                          .hint = "recording.recover makes a file of it, which other programs read"});
    return read_journal(journal);
  });
  if (!out) {
    auto limits = limits_for(path);
    limits.recording_bytes = std::min(limits.recording_bytes, most_bytes);
    out = read_apart(path, limits);
  }
  demand_sound(*out, path);
  return std::move(*out);
}

std::vector<SummaryOrError> read_summaries(std::span<const std::string> paths) {
  std::vector<std::optional<SummaryOrError>> found;
  std::vector<std::string> files;
  for (const auto& path : paths) {
    try {
      found.emplace_back(
          from_journal(path, [](const std::string& journal) { return summarize_journal(journal); }));
    } catch (const Error& error) {
      found.emplace_back(error);
    }
    if (!found.back()) files.push_back(path);
  }
  auto read = summarize_apart(files);
  std::vector<SummaryOrError> out;
  out.reserve(found.size());
  auto next = read.begin();
  for (auto& each : found) out.push_back(each ? std::move(*each) : std::move(*next++));
  return out;
}

Summary read_summary(const std::string& path) {
  auto read = std::move(read_summaries(std::span(&path, 1)).front());
  if (const auto* error = std::get_if<Error>(&read)) throw Error(*error);
  return std::get<Summary>(std::move(read));
}

}  // namespace ferrobench::recordings
