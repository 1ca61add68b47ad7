// Reads JSON, as far as foresee writes it: one line, of which every part is a value. No libraries.
#pragma once

#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace json {

// A value of any kind: a number, a text, a list or an object. true is 1; false and null are 0.
struct Value {
    double number = 0;
    std::string text;
    std::vector<Value> items;
    std::map<std::string, Value> members;

    bool has(const std::string& key) const { return members.count(key) > 0; }

    // The member of an object; one that is missing is an error.
    const Value& operator[](const std::string& key) const {
        const auto found = members.find(key);
        if (found == members.end()) throw std::runtime_error("the message has no " + key);
        return found->second;
    }
};

class Reader {
public:
    explicit Reader(const std::string& line) : at_(line.c_str()) {}

    Value value() {
        skip_blanks();
        if (*at_ == '{') return object();
        if (*at_ == '[') return list();
        Value value;
        if (*at_ == '"') {
            value.text = text();
        } else if (*at_ == 't' || *at_ == 'f' || *at_ == 'n') {
            value.number = *at_ == 't';
            at_ += *at_ == 'f' ? 5 : 4;
        } else {
            char* end = nullptr;
            value.number = std::strtod(at_, &end);
            if (end == at_) throw std::runtime_error("this is not JSON: " + std::string(at_).substr(0, 40));
            at_ = end;
        }
        return value;
    }

private:
    const char* at_;

    void skip_blanks() {
        while (*at_ == ' ' || *at_ == '\t' || *at_ == '\r' || *at_ == '\n') ++at_;
    }

    // Skip blanks and this sign; say whether it was there.
    bool take(char sign) {
        skip_blanks();
        if (*at_ != sign) return false;
        ++at_;
        return true;
    }

    void expect(char sign) {
        if (!take(sign)) throw std::runtime_error(std::string("this is not JSON: expected ") + sign);
    }

    Value object() {
        Value value;
        expect('{');
        if (take('}')) return value;
        do {
            skip_blanks();
            const std::string key = text();
            expect(':');
            value.members[key] = this->value();
        } while (take(','));
        expect('}');
        return value;
    }

    Value list() {
        Value value;
        expect('[');
        if (take(']')) return value;
        do value.items.push_back(this->value());
        while (take(','));
        expect(']');
        return value;
    }

    // A text; foresee's keys and names have no escapes, of which only the sign behind \ is kept here.
    std::string text() {
        std::string letters;
        expect('"');
        while (*at_ && *at_ != '"') {
            if (*at_ == '\\') ++at_;
            letters += *at_++;
        }
        expect('"');
        return letters;
    }
};

inline Value parse(const std::string& line) { return Reader(line).value(); }

}  // namespace json
