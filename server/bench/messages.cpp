#include "server/bench/messages.h"

#include <bit>
#include <cmath>

#include "daq/guard/guard.h"

namespace ferrobench::bench {

namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view magic = "FBBP";

struct Head {
  std::array<char, 4> magic;
  std::uint16_t version, kind;
  std::uint32_t bytes;
};
static_assert(sizeof(Head) == head_bytes);

}  // namespace

std::string frame(Kind kind, std::string_view payload) {
  if (payload.size() > most_payload)
    throw Error(ErrorCode::invalid_params, "the program is too long for the bench",
                Problem{.message = "is too long",
                        .given = payload.size(),
                        .allowed = most_payload,
                        .unit = "bytes",
                        .hint = "split it, or take fewer samples"});
  Head head{{magic[0], magic[1], magic[2], magic[3]},
            version,
            static_cast<std::uint16_t>(kind),
            static_cast<std::uint32_t>(payload.size())};
  std::string out(sizeof head, '\0');
  std::memcpy(out.data(), &head, sizeof head);
  return out.append(payload);
}

std::optional<Message> Inbox::next() {
  Head head{};
  const auto left = bytes_.size() - taken_;
  if (left < sizeof head) return std::nullopt;
  std::memcpy(&head, bytes_.data() + taken_, sizeof head);
  if (std::string_view(head.magic.data(), head.magic.size()) != magic)
    throw Damaged("it does not speak as the bench does");
  if (head.version != version)
    throw Damaged("it speaks version " + std::to_string(head.version) + " of the bench's protocol, not " +
                  std::to_string(version));
  if (head.kind < static_cast<std::uint16_t>(Kind::open) ||
      head.kind > static_cast<std::uint16_t>(Kind::closed))
    throw Damaged("there is no such message");
  if (head.bytes > most_payload) throw Damaged("a message is too long");
  if (left - sizeof head < head.bytes) return std::nullopt;
  Message out{static_cast<Kind>(head.kind), bytes_.substr(taken_ + sizeof head, head.bytes)};
  taken_ += sizeof head + head.bytes;
  if (taken_ == bytes_.size() || taken_ > (1u << 20)) {
    bytes_.erase(0, taken_);
    taken_ = 0;
  }
  return out;
}

Program Program::of(const protocols::Waveform& waveform) {
  return {{waveform.pieces().begin(), waveform.pieces().end()},
          {waveform.segments().begin(), waveform.segments().end()},
          waveform.unit()};
}

protocols::Waveform Program::waveform() const {
  for (const auto& piece : pieces) {
    const bool sampled = piece.kind == protocols::PieceKind::samples;
    if (!(piece.duration > 0) || !std::isfinite(piece.start + piece.duration) ||
        sampled != (piece.levels != nullptr) || (sampled && piece.levels->size() < 2))
      throw Damaged("a piece of the program is none");
  }
  try {
    return {pieces, segments, unit};
  } catch (const std::invalid_argument& failure) {
    throw Damaged(failure.what());
  }
}

Failure Failure::of(const std::exception& error) {
  const auto* known = dynamic_cast<const Error*>(&error);
  if (known == nullptr) return {ErrorCode::internal, error.what(), nlohmann::json::array()};
  auto problems = nlohmann::json::array();
  for (const auto& problem : known->problems()) problems.push_back(to_json(problem));
  return {known->code(), known->message(), std::move(problems)};
}

Error Failure::error() const {
  std::vector<Problem> out;
  if (problems.is_array())
    for (const auto& p : problems)
      if (p.is_object())
        out.push_back({.path = text_at(p, "path"),
                       .message = text_at(p, "message"),
                       .given = p.value("given", nlohmann::json()),
                       .allowed = p.value("allowed", nlohmann::json()),
                       .unit = text_at(p, "unit"),
                       .hint = text_at(p, "hint")});
  return {code, message, std::move(out)};
}

}  // namespace ferrobench::bench
