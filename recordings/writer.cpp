#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>

#include "protocols/common/error.h"
#include "recordings/file.h"
#include "recordings/iso_time.h"
#include "recordings/output_file.h"

namespace ferrobench::recordings {
namespace {

// The new file stands under its name only when all of it is on the disk.
void replace(const std::string& from, const std::string& to) {
  const auto fail = [&] {
    throw Error(ErrorCode::io_error, "the recording could not be put in its place",
                Problem{.message = std::generic_category().message(errno), .given = to});
  };
  if (std::rename(from.c_str(), to.c_str()) != 0) fail();
  const auto folder = std::filesystem::path(to).parent_path();
  const int descriptor = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) fail();
  fsync(descriptor);
  close(descriptor);
}

std::string part_name(const std::string& path) {
  return path + ".part";
}

// Columns of one chunk.
struct Buffer {
  std::vector<double> time;
  std::array<std::vector<double>, 5> channels;
  std::vector<std::int16_t> counts;

  Rows rows() const {
    Rows out{.time = time, .channels = {}, .counts = counts};
    for (std::size_t i = 0; i < channels.size(); ++i) out.channels.at(i) = channels.at(i);
    return out;
  }
  void clear() {
    time.clear();
    for (auto& channel : channels) channel.clear();
    counts.clear();
  }
  void resize(std::size_t rows, std::span<const Channel> present, std::size_t raw_width) {
    time.resize(rows);
    for (const auto channel : present) channels.at(static_cast<std::size_t>(channel)).resize(rows);
    counts.resize(rows * raw_width);
  }
};

}  // namespace

struct Writer::State {
  std::string path;
  Header header;
  std::vector<Channel> channels;
  std::vector<RawColumn> raw;
  std::vector<Event> events;
  OutputFile file;
  Buffer buffer;
  std::uint64_t written = 0;  // rows in the file; the rest is in the buffer
  double last_time = 0;

  // Adds rows [from, from + count) of `rows` to the buffer.
  void take(const Rows& rows, std::size_t from, std::size_t count) {
    const auto add = [&](auto& to, auto values, std::size_t width) {
      const auto part = values.subspan(from * width, count * width);
      to.insert(to.end(), part.begin(), part.end());
    };
    add(buffer.time, rows.time, 1);
    for (const auto channel : channels) {
      const auto i = static_cast<std::size_t>(channel);
      add(buffer.channels.at(i), rows.channels.at(i), 1);
    }
    add(buffer.counts, rows.counts, raw.size());
    last_time = buffer.time.back();
  }

  void write_buffer() {
    file.write(written, buffer.rows());
    written += buffer.time.size();
    buffer.clear();
  }

  // The same file again, shuffled and compressed.
  void pack(const Closing& closing) {
    OutputFile packed(part_name(path), OutputFile::Kind::packed, header, channels, raw, written);
    Buffer block;
    constexpr std::uint64_t block_rows = 16 * OutputFile::chunk_rows;
    for (std::uint64_t first = 0; first < written; first += block_rows) {
      block.resize(std::min(block_rows, written - first), channels, raw.size());
      std::array<std::span<double>, 5> columns;
      for (std::size_t i = 0; i < columns.size(); ++i) columns.at(i) = block.channels.at(i);
      file.read(first, block.time, columns, block.counts);
      packed.write(first, block.rows());
    }
    packed.write_events(events);
    packed.write_closing(closing);
    packed.flush();
    packed.close();
    replace(part_name(path), path);
  }
};

Writer::Writer(const std::string& path, const Header& header, std::span<const Channel> channels,
               std::span<const RawColumn> raw) {
  if (std::filesystem::exists(path))
    throw Error(ErrorCode::io_error, "a file of this name is there already",
                Problem{.message = "would be overwritten", .given = path, .hint = "choose another name"});
  state_ = std::make_unique<State>(State{.path = path,
                                         .header = header,
                                         .channels = {channels.begin(), channels.end()},
                                         .raw = {raw.begin(), raw.end()},
                                         .events = {},
                                         .file = {path, OutputFile::Kind::growing, header, channels, raw},
                                         .buffer = {}});
  state_->file.write_status("running");
  state_->file.flush();
}

Writer::~Writer() {
  if (!state_) return;
  try {
    state_->write_buffer();
    state_->file.flush();
    state_->file.close();
  } catch (const Error&) {  // nobody is left to tell; the file keeps what was flushed before
  }
}

void Writer::append(const Rows& rows) {
  auto& s = *state_;
  for (const auto channel : s.channels)
    if (rows.channels.at(static_cast<std::size_t>(channel)).size() != rows.time.size())
      throw std::invalid_argument("Writer::append: columns differ in length");
  if (rows.counts.size() != rows.time.size() * s.raw.size())
    throw std::invalid_argument("Writer::append: counts do not fit the rows");
  for (std::size_t done = 0; done < rows.time.size();) {
    const auto room = OutputFile::chunk_rows - (s.written + s.buffer.time.size()) % OutputFile::chunk_rows;
    const auto count = std::min<std::size_t>(room, rows.time.size() - done);
    s.take(rows, done, count);
    done += count;
    if (count == room) s.write_buffer();
  }
}

void Writer::add_event(const Event& event) {
  state_->events.push_back(event);
  state_->file.add_event(event);
}

void Writer::flush() {
  state_->write_buffer();
  state_->file.flush();
}

std::uint64_t Writer::rows() const {
  return state_ ? state_->written + state_->buffer.time.size() : 0;
}

void Writer::finish(const std::string& status, const std::string& reason,
                    std::span<const SegmentRow> segments, const std::array<std::optional<double>, 5>& noise) {
  auto& s = *state_;
  s.write_buffer();
  const Closing closing{iso_after(s.header.start_time, s.last_time).value_or(iso_now()), status, reason,
                        segments, noise};
  s.file.write_closing(closing);
  s.file.flush();
  try {
    s.pack(closing);
  } catch (const Error& error) {
    // Without room for a second copy the first one stays: complete, only larger.
    std::filesystem::remove(part_name(s.path));
    if (error.code() != ErrorCode::disk_full) throw;
  }
  state_.reset();
}

void write_recording(const std::string& path, const Recording& recording) {
  std::vector<Channel> channels;
  Rows rows{.time = recording.time, .channels = {}, .counts = {}};
  for (const auto channel : all_channels) {
    if (!recording.has(channel)) continue;
    channels.push_back(channel);
    rows.channels.at(static_cast<std::size_t>(channel)) = recording.at(channel);
  }
  std::span<const RawColumn> raw;
  if (recording.raw) {
    raw = recording.raw->columns;
    rows.counts = recording.raw->counts;
  }
  try {
    OutputFile file(part_name(path), OutputFile::Kind::packed, recording.header, channels, raw,
                    recording.size());
    file.write(0, rows);
    file.write_events(recording.events);
    file.write_closing(
        {recording.end_time, recording.status, recording.reason, recording.segments, recording.noise});
    file.flush();
    file.close();
    replace(part_name(path), path);
  } catch (const Error&) {
    std::filesystem::remove(part_name(path));
    throw;
  }
}

}  // namespace ferrobench::recordings
