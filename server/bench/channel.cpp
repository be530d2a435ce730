#include "server/bench/channel.h"

#include <fcntl.h>
#include <sys/socket.h>

#include <cerrno>

namespace ferrobench::bench {

namespace {

constexpr std::size_t most_files = 8;  // that came and wait

union Control {
  char bytes[CMSG_SPACE(sizeof(int))];
  cmsghdr aligned;
};

}  // namespace

Channel::Channel(Descriptor socket) : socket_(std::move(socket)) {
  fcntl(socket_.get(), F_SETFL, fcntl(socket_.get(), F_GETFL) | O_NONBLOCK);
}

void Channel::send(std::string frame, Descriptor file) {
  queued_ += frame.size();
  out_.push_back({std::move(frame), std::move(file)});
}

bool Channel::flush() {
  while (!out_.empty()) {
    auto& first = out_.front();
    iovec part{first.bytes.data() + sent_, first.bytes.size() - sent_};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    Control control{};
    if (first.file && sent_ == 0) {
      message.msg_control = control.bytes;
      message.msg_controllen = sizeof control.bytes;
      auto* head = CMSG_FIRSTHDR(&message);
      head->cmsg_level = SOL_SOCKET;
      head->cmsg_type = SCM_RIGHTS;
      head->cmsg_len = CMSG_LEN(sizeof(int));
      const int file = first.file.get();
      std::memcpy(CMSG_DATA(head), &file, sizeof file);
    }
    const auto done = sendmsg(socket_.get(), &message, MSG_NOSIGNAL);
    if (done < 0 && errno == EINTR) continue;
    if (done < 0) return errno == EAGAIN || errno == EWOULDBLOCK;
    sent_ += static_cast<std::size_t>(done);
    queued_ -= static_cast<std::size_t>(done);
    if (sent_ < first.bytes.size()) continue;
    sent_ = 0;
    out_.pop_front();
  }
  return true;
}

bool Channel::receive() {
  std::array<char, 1u << 16> bytes;
  for (;;) {
    iovec part{bytes.data(), bytes.size()};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    Control control{};
    message.msg_control = control.bytes;
    message.msg_controllen = sizeof control.bytes;
    const auto got = recvmsg(socket_.get(), &message, MSG_CMSG_CLOEXEC);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return errno == EAGAIN || errno == EWOULDBLOCK;
    if (got == 0) return false;
    for (auto* head = CMSG_FIRSTHDR(&message); head != nullptr; head = CMSG_NXTHDR(&message, head)) {
      if (head->cmsg_level != SOL_SOCKET || head->cmsg_type != SCM_RIGHTS) continue;
      int file = -1;
      std::memcpy(&file, CMSG_DATA(head), sizeof file);
      files_.emplace_back(file);
      if (files_.size() > most_files) files_.pop_front();
    }
    inbox_.add({bytes.data(), static_cast<std::size_t>(got)});
  }
}

Descriptor Channel::take_file() {
  if (files_.empty()) return {};
  auto out = std::move(files_.front());
  files_.pop_front();
  return out;
}

}  // namespace ferrobench::bench
