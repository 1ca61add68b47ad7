//! Reads JSON, as far as foresee writes it: one line, of which every part is a value. No crates.

use std::collections::HashMap;
use std::ops::Index;

/// A value of any kind. `true` is 1; `false` and `null` are 0.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    Number(f64),
    Text(String),
    List(Vec<Value>),
    Object(HashMap<String, Value>),
}

impl Value {
    /// The number; 0 for a value of another kind.
    pub fn number(&self) -> f64 {
        if let Value::Number(number) = self { *number } else { 0.0 }
    }

    /// The text; empty for a value of another kind.
    pub fn text(&self) -> &str {
        if let Value::Text(text) = self { text } else { "" }
    }

    /// The items of a list; none for a value of another kind.
    pub fn items(&self) -> &[Value] {
        if let Value::List(items) = self { items } else { &[] }
    }

    /// The member of an object, if it has one of this name.
    pub fn get(&self, key: &str) -> Option<&Value> {
        if let Value::Object(members) = self { members.get(key) } else { None }
    }
}

impl Index<&str> for Value {
    type Output = Value;

    fn index(&self, key: &str) -> &Value {
        self.get(key).unwrap_or_else(|| panic!("the message has no {key}"))
    }
}

/// Return the value of a line.
pub fn parse(line: &str) -> Result<Value, String> {
    Reader { bytes: line.as_bytes(), at: 0 }.value()
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn value(&mut self) -> Result<Value, String> {
        match self.peek() {
            b'{' => self.object(),
            b'[' => self.list(),
            b'"' => Ok(Value::Text(self.text()?)),
            b't' => self.word(4, 1.0),
            b'f' => self.word(5, 0.0),
            b'n' => self.word(4, 0.0),
            _ => self.number(),
        }
    }

    /// The next byte that is not blank; 0 at the end.
    fn peek(&mut self) -> u8 {
        while self.bytes.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
        self.bytes.get(self.at).copied().unwrap_or(0)
    }

    /// Take this byte; say whether it was there.
    fn take(&mut self, byte: u8) -> bool {
        let there = self.peek() == byte;
        self.at += usize::from(there);
        there
    }

    fn expect(&mut self, byte: u8) -> Result<(), String> {
        if self.take(byte) { Ok(()) } else { Err(format!("not JSON: expected {} at byte {}", byte as char, self.at)) }
    }

    fn word(&mut self, length: usize, number: f64) -> Result<Value, String> {
        self.at += length;
        Ok(Value::Number(number))
    }

    fn number(&mut self) -> Result<Value, String> {
        let start = self.at;
        while self.bytes.get(self.at).is_some_and(|byte| b"+-.eE0123456789".contains(byte)) {
            self.at += 1;
        }
        let digits = std::str::from_utf8(&self.bytes[start..self.at]).unwrap_or("");
        digits.parse().map(Value::Number).map_err(|error| format!("not JSON: {error} at byte {start}"))
    }

    /// A text; foresee's keys and names have no escapes, of which only the sign behind \ is kept here.
    fn text(&mut self) -> Result<String, String> {
        self.expect(b'"')?;
        let mut bytes = Vec::new();
        while let Some(&byte) = self.bytes.get(self.at) {
            self.at += 1;
            match byte {
                b'"' => return String::from_utf8(bytes).map_err(|error| error.to_string()),
                b'\\' => {
                    bytes.extend(self.bytes.get(self.at));
                    self.at += 1;
                }
                _ => bytes.push(byte),
            }
        }
        Err("not JSON: a text does not end".to_string())
    }

    fn list(&mut self) -> Result<Value, String> {
        self.expect(b'[')?;
        let mut items = Vec::new();
        if self.take(b']') {
            return Ok(Value::List(items));
        }
        loop {
            items.push(self.value()?);
            if !self.take(b',') {
                break;
            }
        }
        self.expect(b']')?;
        Ok(Value::List(items))
    }

    fn object(&mut self) -> Result<Value, String> {
        self.expect(b'{')?;
        let mut members = HashMap::new();
        if self.take(b'}') {
            return Ok(Value::Object(members));
        }
        loop {
            let key = self.text()?;
            self.expect(b':')?;
            members.insert(key, self.value()?);
            if !self.take(b',') {
                break;
            }
        }
        self.expect(b'}')?;
        Ok(Value::Object(members))
    }
}
