#include "recordings/journal/records.h"

#include <zlib.h>

#include <bit>
#include <cstring>

#include "base/error.h"

namespace ferrobench::recordings {
namespace {

static_assert(std::endian::native == std::endian::little, "the journal is written as it lies in memory");

constexpr std::uint32_t magic = 0x524a4246;  // "FBJR"

struct HeadBytes {
  std::uint32_t magic, kind;
  std::uint64_t sequence, bytes;
  std::uint32_t rows, payload_checksum, zero, head_checksum;
};
static_assert(sizeof(HeadBytes) == head_bytes);

std::uint32_t checksum(std::string_view bytes) {
  return static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::uint32_t own_checksum(const HeadBytes& head) {
  return checksum({reinterpret_cast<const char*>(&head), offsetof(HeadBytes, head_checksum)});
}

}  // namespace

std::string encode(RecordKind kind, std::uint64_t sequence, std::uint32_t rows, std::string_view payload,
                   std::string storage) {
  HeadBytes head{
      magic, static_cast<std::uint32_t>(kind), sequence, payload.size(), rows, checksum(payload), 0, 0};
  head.head_checksum = own_checksum(head);
  storage.assign(reinterpret_cast<const char*>(&head), sizeof head);
  storage.append(payload);
  return storage;
}

std::optional<RecordHead> decode_head(std::string_view bytes) {
  HeadBytes head{};
  if (bytes.size() < sizeof head) return std::nullopt;
  std::memcpy(&head, bytes.data(), sizeof head);
  if (head.magic != magic || head.zero != 0 || head.head_checksum != own_checksum(head) ||
      head.bytes > most_payload || head.kind < static_cast<std::uint32_t>(RecordKind::begin) ||
      head.kind > static_cast<std::uint32_t>(RecordKind::end))
    return std::nullopt;
  return RecordHead{static_cast<RecordKind>(head.kind), head.sequence, head.bytes, head.rows,
                    head.payload_checksum};
}

bool fits(const RecordHead& head, std::string_view payload) {
  return payload.size() == head.bytes && checksum(payload) == head.checksum;
}

std::string rows_payload(const Begin& begin, const Rows& rows, std::size_t first, std::size_t count,
                         std::string storage) {
  storage.clear();
  storage.reserve(count * begin.row_bytes());
  const auto add = [&](const auto* values, std::size_t width) {
    storage.append(reinterpret_cast<const char*>(values + first * width), count * width * sizeof *values);
  };
  add(rows.time.data(), 1);
  for (const auto channel : begin.channels)
    add(rows.channels.at(static_cast<std::size_t>(channel)).data(), 1);
  if (!begin.raw.empty()) add(rows.counts.data(), begin.raw.size());
  return storage;
}

void add_rows(const Begin& begin, const RecordHead& head, std::string_view payload, Columns& out) {
  const auto take = [&](auto& column, std::size_t width) {
    const auto old = column.size(), count = head.rows * width;
    const auto bytes = count * sizeof column[0];
    column.resize(old + count);
    if (count > 0) std::memcpy(column.data() + old, payload.data(), bytes);
    payload.remove_prefix(bytes);
  };
  take(out.time, 1);
  for (const auto channel : begin.channels) take(out.channels.at(static_cast<std::size_t>(channel)), 1);
  take(out.counts, begin.raw.size());
}

}  // namespace ferrobench::recordings
