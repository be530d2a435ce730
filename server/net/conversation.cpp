#include "server/net/conversation.h"

#include <boost/asio/post.hpp>
#include <utility>

namespace ferrobench::server {
namespace {

constexpr std::size_t inbox_size = 256;  // texts, and no more bytes than the longest may have

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
  Waiting next{.text = std::move(text)};
  if (calling_ || !inbox_.empty() || !replies_.empty()) {
    const auto asked = service_.dispatcher.look(next.text);
    next.again = asked.stop;
    next.silent = asked.stop && asked.alone;
    if (asked.stop) overtake(next);
  }
  inbox_bytes_ += next.text.size();
  inbox_.push_back(std::move(next));
  pump();
}

// With a context of its own, since another call may be using this connection's.
void Conversation::overtake(const Waiting& stop) {
  ++overtaking_;
  auto context = std::make_shared<CallContext>(
      CallContext{.client = context_->client, .lease = "", .subscriber = nullptr});
  service_.run(
      Lane::urgent,
      [&dispatcher = service_.dispatcher, text = stop.text, context = std::move(context)] {
        return dispatcher.handle(text, *context, Part::stops);
      },
      [self = shared_from_this(), answered = stop.silent](std::optional<std::string> reply) {
        --self->overtaking_;
        if (reply && answered)
          self->replies_.push_back(std::make_shared<const std::string>(std::move(*reply)));
        self->pump();
      });
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
  replies_.push_back(std::make_shared<const std::string>(std::move(text)));
  pump();
}

void Conversation::stop() {
  last_ = true;
  inbox_.clear();
  inbox_bytes_ = 0;
  pump();
}

void Conversation::finish(const std::string& why) {
  if (std::exchange(finished_, true)) return;
  if (context_->subscriber) {
    service_.hub.remove(*context_->subscriber);
    context_->subscriber->close();
  }
  if (service_.content.disconnected && !service_.stopping)
    boost::asio::post(service_.usual,
                      [tell = service_.content.disconnected, gone = context_] { tell(*gone); });
  hang_up(why, sending_ != nullptr);
}

void Conversation::pump() {
  if (finished_) return;
  if (context_->subscriber->closed()) return finish("too slow: too many notifications were lost");
  if (!reading_ && !last_ && inbox_.size() < inbox_size && inbox_bytes_ < service_.options.max_body_bytes) {
    reading_ = true;
    read();
  }
  if (!calling_ && replies_.empty() && !inbox_.empty() && !(overtaking_ > 0 && inbox_.front().again)) {
    calling_ = true;
    auto next = std::move(inbox_.front());
    inbox_.pop_front();
    inbox_bytes_ -= next.text.size();
    context_->again = next.again;
    service_.call(std::move(next.text), context_,
                  [self = shared_from_this(), silent = next.silent](std::optional<std::string> reply) {
                    self->calling_ = false;
                    if (reply && !silent)
                      self->replies_.push_back(std::make_shared<const std::string>(std::move(*reply)));
                    self->pump();
                  });
  }
  if (sending_) return;
  if (!replies_.empty()) {
    sending_ = std::move(replies_.front());
    replies_.pop_front();
  } else if (last_ && !calling_ && overtaking_ == 0 && inbox_.empty()) {
    return finish(service_.stopping ? "the daemon stops" : "");
  } else {
    sending_ = context_->subscriber->next();
  }
  if (sending_) write(*sending_);
}

}  // namespace ferrobench::server
