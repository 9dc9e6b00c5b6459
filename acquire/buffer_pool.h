#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

namespace flamefield {

// Memory for frames, used again: new pages for every frame of a fast array cost more than receiving it. A
// buffer comes back by itself when its last holder lets go, whichever thread that is; the pool may be gone.
class BufferPool {
 public:
  using Buffer = std::vector<std::byte>;

  explicit BufferPool(std::size_t most_kept) : store_(std::make_shared<Store>()) {
    store_->most_kept = most_kept;
  }

  std::shared_ptr<Buffer> take(std::size_t bytes) {
    std::unique_ptr<Buffer> buffer;
    {
      const std::lock_guard lock(store_->mutex);
      if (!store_->idle.empty()) {
        buffer = std::move(store_->idle.back());
        store_->idle.pop_back();
      }
    }
    if (!buffer) buffer = std::make_unique<Buffer>();
    buffer->resize(bytes);
    return {buffer.release(), [store = store_](Buffer* returned) {
              std::unique_ptr<Buffer> owner(returned);
              const std::lock_guard lock(store->mutex);
              if (store->idle.size() < store->most_kept) store->idle.push_back(std::move(owner));
            }};
  }

 private:
  struct Store {
    std::mutex mutex;
    std::size_t most_kept = 0;
    std::vector<std::unique_ptr<Buffer>> idle;
  };
  std::shared_ptr<Store> store_;
};

}  // namespace flamefield
