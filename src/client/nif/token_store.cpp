#include "client/nif/token_store.hpp"

#include <array>
#include <utility>

#include "client/nif/token_record.hpp"

namespace gimnet::nif {

TokenStore::TokenStore(std::string name, bool enabled) : name_(std::move(name)), wanted_(enabled) {}

TokenStore::~TokenStore() = default;

std::vector<std::byte> TokenStore::find(const std::string& address) {
  if (!open(address, false)) return {};
  // One byte more than is legal, so that a longer file shows.
  std::array<std::byte, kTokenRecordBytesMax + 1> memory;
  const std::size_t size = file_.read(memory);
  if (size == 0) return {};  // a program ended before it wrote its token
  const auto record = read_token_record(std::span(memory).first(size));
  if (record && record->address == address && record->name == name_) return record->token;
  unused_ = "the token file " + path() + " is not used, and the node may get a new id: " +
            (record ? "it is that of another node" : "what it holds is no session token");
  return {};
}

std::string TokenStore::path() const {
  return folder_->path() + "/" + token_file_name(address_, name_);
}

void TokenStore::keep(const std::string& address, const std::vector<std::byte>& token) {
  if (!enabled()) return;
  kept_ = false;
  if (file_.is_open() && address_ != address) forget();
  if (!open(address, true)) return;
  const auto record = write_token_record({address, name_, token});
  kept_ = record && file_.write(*record);
  if (kept_) {
    fault_ = std::exchange(unused_, {});
    return;
  }
  fault_ = "the session token is not kept over a crash: " + path() + " cannot be written";
  forget();
}

void TokenStore::forget() {
  if (file_.is_open()) file_.remove(*folder_, token_file_name(address_, name_));
  kept_ = false;
}

void TokenStore::rename(std::string name) {
  forget();
  fault_.clear();
  name_ = std::move(name);
}

void TokenStore::release() {
  file_.close();
  kept_ = false;
}

bool TokenStore::open(const std::string& address, bool made) {
  if (!enabled()) return false;
  if (file_.is_open() && address_ == address) return true;
  file_.close();
  if (folder_ == nullptr || !folder_->fault().empty()) folder_ = std::make_unique<PrivateFolder>();
  if (!folder_->fault().empty()) {
    fault_ = "the session token is not kept over a crash: " + folder_->fault();
    return false;
  }
  const LockedFile::State state = file_.open(*folder_, token_file_name(address, name_), made);
  address_ = address;
  if (state == LockedFile::State::in_use) {
    fault_ =
        "the session token is not kept over a crash: another node of that name keeps its own in " +
        path();
  } else if (state == LockedFile::State::refused) {
    fault_ = "the session token is not kept over a crash: " + path() +
             " is another user's, open to others, or no file; remove it";
  }
  return state == LockedFile::State::open;
}

}  // namespace gimnet::nif
