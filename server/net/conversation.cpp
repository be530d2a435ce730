#include "server/net/conversation.h"

#include <boost/asio/post.hpp>
#include <utility>

namespace ferrobench::server {
namespace {

constexpr std::size_t inbox_size = 16;

}  // namespace

Conversation::Conversation(Service& service, std::shared_ptr<CallContext> context)
    : Session(service), context_(std::move(context)) {}

Conversation::~Conversation() {
  if (context_->subscriber) context_->subscriber->close();
}

void Conversation::begin() {
  // The publisher's thread must never hold the session: the weak reference is only looked at on the io
  // thread.
  context_->subscriber =
      std::make_shared<Subscriber>(service_.options.outbox, [&io = service_.io, weak = weak_from_this()] {
        boost::asio::post(io, [weak] {
          if (const auto self = weak.lock()) self->pump();
        });
      });
  pump();
}

void Conversation::received(std::string text) {
  reading_ = false;
  inbox_.push_back(std::move(text));
  pump();
}

void Conversation::written() {
  sending_.reset();
  pump();
}

void Conversation::ended() {
  reading_ = false;
  last_ = true;
  pump();
}

void Conversation::broken() {
  reading_ = false;
  finish("");
}

void Conversation::farewell(std::string text) {
  reading_ = false;
  last_ = true;
  reply_ = std::make_shared<const std::string>(std::move(text));
  pump();
}

void Conversation::stop() {
  last_ = true;
  inbox_.clear();
  pump();
}

void Conversation::finish(const std::string& why) {
  if (std::exchange(finished_, true)) return;
  if (context_->subscriber) {
    service_.hub.remove(*context_->subscriber);
    context_->subscriber->close();
  }
  if (service_.content.disconnected && !service_.stopping)
    boost::asio::post(service_.workers,
                      [tell = service_.content.disconnected, gone = context_] { tell(*gone); });
  hang_up(why, sending_ != nullptr);
}

void Conversation::pump() {
  if (finished_) return;
  if (context_->subscriber->closed()) return finish("too slow: too many notifications were lost");
  if (!reading_ && !last_ && inbox_.size() < inbox_size) {
    reading_ = true;
    read();
  }
  if (!calling_ && !reply_ && !inbox_.empty()) {
    calling_ = true;
    auto text = std::move(inbox_.front());
    inbox_.pop_front();
    service_.call(std::move(text), context_, [self = shared_from_this()](std::optional<std::string> reply) {
      self->calling_ = false;
      if (reply) self->reply_ = std::make_shared<const std::string>(std::move(*reply));
      self->pump();
    });
  }
  if (sending_) return;
  if (reply_) {
    sending_ = std::exchange(reply_, nullptr);
  } else if (last_ && !calling_ && inbox_.empty()) {
    return finish(service_.stopping ? "the daemon stops" : "");
  } else {
    sending_ = context_->subscriber->next();
  }
  if (sending_) write(*sending_);
}

}  // namespace ferrobench::server
