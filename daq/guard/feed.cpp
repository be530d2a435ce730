#include "daq/guard/feed.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::daq {

using protocols::PieceKind;

namespace {

constexpr std::size_t most_ahead = 4096;  // rows that a driver asks for at a time, at most

}  // namespace

std::string_view end_name(End end) {
  constexpr std::array<std::string_view, 6> names{"none",  "complete",  "stopped",
                                                  "limit", "interlock", "fault"};
  return names.at(static_cast<std::size_t>(end));
}

Feed::Feed(protocols::SampledWaveform program, const Limits& limits)
    : program_(std::move(program)),
      limits_(limits),
      stop_slew_(limits.stop_slew),
      limiter_(limits, program_.rate(), program_.value(0)),
      commands_{program_.value(0)} {
  constexpr double longest_wait = 1;  // s, between a command and its row
  commands_.reserve(static_cast<std::size_t>(longest_wait * rate()) + most_ahead);
  const auto table = program_.waveform().segments();
  for (const auto& piece : program_.waveform().pieces()) {
    auto& row = program_segments_.emplace_back();
    row.kind = piece.kind == PieceKind::hold ? "hold" : "ramp";
    row.level = piece.to;
    if (const auto index = program_segments_.size() - 1; index < table.size()) {
      row.label = table[index].label;
      row.rate = table[index].rate;
    }
  }
  for (std::size_t i = 0; i < program_segments_.size(); ++i) selects_ |= !program_.recorded_rows(i).all();
  if (selects_) {
    is_recorded_.reserve(commands_.capacity());
    is_recorded_.push_back(1);
  }
  constexpr std::size_t ways_back = 2;  // a stop, and a hastened one
  segments_.reserve(program_segments_.size() + ways_back);
}

bool Feed::over() const {
  return stopping() ? limiter_.level() == 0 : index_ == program_.waveform().pieces().size();
}

std::uint64_t Feed::expected() const {
  if (!stopping()) return program_.size() + waited_;
  return issued_ + static_cast<std::uint64_t>(std::ceil(std::abs(limiter_.level()) / stop_slew_ * rate()));
}

LinearPiece Feed::next(std::uint64_t max_samples) {
  if (max_samples == 0 || over()) return {};
  const double from = limiter_.level();
  const bool leaving = stopping();
  const auto index = index_;
  LinearPiece piece = leaving ? stop_piece(max_samples) : program_piece(max_samples);
  piece.level = limiter_.pass(piece.level, piece.samples);
  const bool altered = limiter_.altered();
  account(piece, from, index_ != index);
  if (!leaving && altered) stop(End::limit, "the program went past a limit and was held back");
  return piece;
}

LinearPiece Feed::program_piece(std::uint64_t max_samples) {
  const auto& piece = program_.waveform().pieces()[index_];
  const auto begin = program_.corners()[index_];
  const auto length = program_.corners()[index_ + 1] - begin;

  if (opened_ == index_) {
    ++opened_;
    open_segment(std::move(program_segments_[index_]));
    rows_ = program_.recorded_rows(index_);
  }
  if (pause_wanted_ && piece.kind == PieceKind::hold) {
    if (!paused_) say("pause", "paused by request; the hold gets longer");
    paused_ = true;
    waited_ += max_samples;
    return {.samples = max_samples, .level = limiter_.level(), .waiting = true};
  }

  const bool bent = piece.kind == PieceKind::sine || piece.kind == PieceKind::samples;
  const std::uint64_t count = bent ? 1 : std::min(max_samples, length - offset_);
  offset_ += count;
  const double level = program_.value(begin + offset_);
  if (offset_ == length) {
    ++index_;
    offset_ = 0;
  }
  return {.samples = count, .level = level};
}

LinearPiece Feed::stop_piece(std::uint64_t max_samples) {
  const double level = limiter_.level();
  const double step = stop_slew_ / rate();
  const double needed = std::ceil(std::abs(level) / step);
  if (needed <= static_cast<double>(max_samples)) return {.samples = static_cast<std::uint64_t>(needed)};
  return {.samples = max_samples,
          .level = level - std::copysign(step * static_cast<double>(max_samples), level)};
}

// Whether the next row that is issued is recorded.
bool Feed::decide(bool corner) {
  const bool due = rows_.next();
  last_is_recorded_ = due || corner;
  recorded_issued_ += last_is_recorded_ ? 1 : 0;
  return last_is_recorded_;
}

void Feed::account(const LinearPiece& piece, double from, bool corner) {
  const double share = (piece.level - from) / static_cast<double>(piece.samples);
  const std::size_t old = commands_.size();
  commands_.resize(old + piece.samples);
  for (std::uint64_t i = 1; i < piece.samples; ++i)
    commands_[old + i - 1] = from + share * static_cast<double>(i);
  commands_.back() = piece.level;
  if (selects_)
    for (std::uint64_t i = 1; i <= piece.samples; ++i)
      is_recorded_.push_back(decide(corner && i == piece.samples) ? 1 : 0);
  else
    recorded_issued_ += piece.samples;
  issued_ += piece.samples;

  const double duration = static_cast<double>(piece.samples) / rate();
  const double reversed =
      reverse_.add(linear_time_below(from, piece.level, duration, limits_.reverse_field_threshold));
  // The chords of a sampled sine cross the threshold up to a sample away from where the checked sine does.
  if (reversed > limits_.reverse_field_time * (1 + 1e-9) + 2 / rate())
    stop(End::limit, "the field was reversed for longer than reverse_field_time allows");
}

void Feed::pause() {
  const auto pieces = program_.waveform().pieces();
  const auto hold =
      std::find_if(pieces.begin() + static_cast<std::ptrdiff_t>(std::min(index_, pieces.size())),
                   pieces.end(), [](const auto& p) { return p.kind == PieceKind::hold; });
  if (stopping() || hold == pieces.end())
    throw Error(ErrorCode::bad_state, "there is no hold left to pause in",
                Problem{.message = "a program can only pause in a hold", .hint = "stop the run instead"});
  pause_wanted_ = true;
}

void Feed::resume() {
  if (paused_) say("resume", "resumed by request");
  pause_wanted_ = paused_ = false;
}

void Feed::stop(End end, const std::string& reason) {
  if (stopping() || over()) return;
  end_ = end;
  reason_ = reason;
  pause_wanted_ = paused_ = false;
  say(end == End::stopped ? "stop" : end_name(end), reason);
  rows_ = {};  // of the way to zero every row
  if (!last_is_recorded_ && !is_recorded_.empty()) {
    is_recorded_.back() = 1;
    last_is_recorded_ = true;
    ++recorded_issued_;
  }
  open_segment({.kind = "ramp", .label = "safe stop", .level = 0, .rate = stop_slew_});
}

void Feed::hasten(double slew) {
  if (!stopping() || over() || !(slew > stop_slew_)) return;
  stop_slew_ = slew;
  say("stop", "asked for again: the rest of the way to zero goes faster");
  open_segment({.kind = "ramp", .label = "hastened stop", .level = 0, .rate = stop_slew_});
}

// A segment starts with the last row of the one before, where both have the same level; with its own first
// row where that one was read already and is not recorded.
void Feed::open_segment(recordings::SegmentRow row) {
  row.start_sample = static_cast<std::int64_t>(recorded_issued_ - (last_is_recorded_ ? 1 : 0));
  segments_.push_back(std::move(row));
}

void Feed::say(std::string_view kind, std::string message) {
  events_.push_back({static_cast<double>(issued_ - 1) / rate(), std::string(kind), std::move(message)});
}

void Feed::take_rows(SampleBlock& block) {
  const auto first = block.first_sample;
  const auto lost = static_cast<std::size_t>(first - taken_), end = lost + block.rows;
  const auto at = [](auto& rows, std::size_t row) { return rows.begin() + static_cast<std::ptrdiff_t>(row); };
  block.command.assign(at(commands_, lost), at(commands_, end));
  commands_.erase(commands_.begin(), at(commands_, end));
  taken_ = first + block.rows;
  if (!selects_) {
    recorded_taken_ = taken_;
    return;
  }
  if (block.time.empty())
    for (std::size_t i = 0; i < block.rows; ++i)
      block.time.push_back(static_cast<double>(first + i) / rate());
  recorded_taken_ += static_cast<std::uint64_t>(std::count(is_recorded_.begin(), at(is_recorded_, lost), 1));
  block.first_sample = recorded_taken_;
  block.select(std::span(is_recorded_).subspan(lost, block.rows));
  recorded_taken_ += block.rows;
  is_recorded_.erase(is_recorded_.begin(), at(is_recorded_, end));
}

void Feed::take_events(std::vector<recordings::Event>& out) {
  std::move(events_.begin(), events_.end(), std::back_inserter(out));
  events_.clear();
}

std::vector<recordings::SegmentRow> Feed::segments(std::uint64_t rows) const {
  std::vector<recordings::SegmentRow> out;
  const auto total = static_cast<std::int64_t>(std::min(rows, recorded_issued_));
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    auto row = segments_[i];
    row.end_sample = i + 1 < segments_.size() ? std::min(segments_[i + 1].start_sample, total) : total;
    if (row.end_sample > row.start_sample) out.push_back(std::move(row));
  }
  return out;
}

}  // namespace ferrobench::daq
