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
  const auto record = read_token_record(std::span(memory).first(file_.read(memory)));
  if (!record || record->address != address || record->name != name_) return {};
  return record->token;
}

void TokenStore::keep(const std::string& address, const std::vector<std::byte>& token) {
  if (!enabled()) return;
  kept_ = false;
  if (file_.is_open() && address_ != address) forget();
  if (!open(address, true)) return;
  const auto record = write_token_record({address, name_, token});
  kept_ = record && file_.write(*record);
  if (kept_) {
    fault_.clear();
    return;
  }
  fault_ = "the session token is not kept over a crash: its file cannot be written";
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
    fault_ = "the session token is not kept over a crash: another node of that name keeps its own";
  } else if (state == LockedFile::State::refused) {
    fault_ = "the session token is not kept over a crash: its file is another user's, or no file";
  }
  return state == LockedFile::State::open;
}

}  // namespace gimnet::nif
