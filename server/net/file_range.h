// A part of a file as the body of an HTTP reply, read piece by piece while it is sent.
#pragma once

#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/optional.hpp>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace ferrobench::server {

// Bytes [first, first + length) of a file.
struct ByteRange {
  std::uint64_t first = 0;
  std::uint64_t length = 0;
};

// "bytes=5-9", "bytes=5-", "bytes=-4" within a file of `size` bytes. Length 0: outside the file. Nothing: not
// a single range, which HTTP says to ignore.
std::optional<ByteRange> parse_range(std::string_view header, std::uint64_t size);

struct FileRange : ByteRange {
  std::shared_ptr<const int> descriptor;  // closed with the last copy

  // All of a plain file; nothing if it cannot be opened, or is a link to one.
  static std::optional<FileRange> open(const std::string& path);
};

struct FileRangeBody {
  using value_type = FileRange;

  static std::uint64_t size(const value_type& body) { return body.length; }

  class writer {  // NOLINT(readability-identifier-naming): the name that Beast looks for
   public:
    using const_buffers_type = boost::asio::const_buffer;

    template <bool isRequest, class Fields, template <bool, class> class Header>
    writer(const Header<isRequest, Fields>&, const value_type& body)
        : body_(body), at_(body.first), left_(body.length) {}

    static void init(boost::beast::error_code& ec) { ec = {}; }
    boost::optional<std::pair<const_buffers_type, bool>> get(boost::beast::error_code& ec);

   private:
    const value_type& body_;
    std::uint64_t at_;
    std::uint64_t left_;
    std::array<char, 64u << 10> chunk_;
  };
};

}  // namespace ferrobench::server
