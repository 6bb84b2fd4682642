//! What a Python pickle says, without doing what it asks for: what would be called or made is kept as its name and arguments.
//!
//! Format: Python's `pickletools`, protocols 2 to 5. The libraries that read pickles refuse them where numbers are: NumPy's
//! arrays are calls, and PyTorch's lie outside.

use std::collections::BTreeMap;
use std::ops::Range;

/// Where a value stands among those of its pickle. Values that hold each other, or themselves, are numbers here and no pointers:
/// nothing is followed but by who asks.
pub(super) type Id = usize;

/// A value. Texts and bytes are where they lie in the file.
pub(super) enum Node {
    Nothing,
    Bool(bool),
    Integer(i64),
    Number(f64),
    Text(Range<usize>),
    Bytes(Range<usize>),
    /// List, tuple or set.
    Sequence(Vec<Id>),
    Dict(Vec<(Id, Id)>),
    /// A class or a function.
    Global(Box<Global>),
    Object(Box<Object>),
    /// What the program that wrote it keeps elsewhere.
    Elsewhere(Id),
    /// An integer of more than 64 bits.
    Other,
}

pub(super) struct Global {
    module: Range<usize>,
    name: Range<usize>,
}

/// What a call would give, or an object of a class.
pub(super) struct Object {
    pub(super) callee: Id,
    pub(super) arguments: Id,
    pub(super) state: Option<Id>,
    /// Appended, as to a deque.
    pub(super) items: Vec<Id>,
    /// Set, as of an ordered dictionary.
    pub(super) entries: Vec<(Id, Id)>,
}

pub(super) struct Pickle<'a> {
    bytes: &'a [u8],
    nodes: Vec<Node>,
    root: Id,
}

impl<'a> Pickle<'a> {
    /// # Errors
    /// What is wrong with it, and at which byte.
    pub(super) fn parse(bytes: &'a [u8], values_max: usize) -> Result<Self, String> {
        let mut machine = Machine {
            bytes,
            at: 0,
            values_left: values_max,
            nodes: Vec::new(),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: BTreeMap::new(),
        };
        let root = machine.run()?;
        let nodes = machine.nodes;
        Ok(Self { bytes, nodes, root })
    }

    pub(super) fn root(&self) -> Id {
        self.root
    }

    pub(super) fn node(&self, id: Id) -> &Node {
        &self.nodes[id]
    }

    pub(super) fn text(&self, id: Id) -> Option<&'a str> {
        match self.node(id) {
            Node::Text(range) => self.str(range),
            _ => None,
        }
    }

    /// Bytes, also as protocol 2 has them: a text whose letters are bytes.
    pub(super) fn bytes(&self, id: Id) -> Option<std::borrow::Cow<'a, [u8]>> {
        match self.node(id) {
            Node::Bytes(range) | Node::Text(range) => Some(self.bytes[range.clone()].into()),
            Node::Object(object) => {
                match (self.global(object.callee)?, self.items(object.arguments)?) {
                    (("_codecs", "encode"), [text, ..]) => {
                        let letters = self.text(*text)?.chars();
                        let bytes: Option<Vec<u8>> =
                            letters.map(|c| u8::try_from(c).ok()).collect();
                        Some(bytes?.into())
                    }
                    (("__builtin__" | "builtins", "bytearray" | "bytes"), [bytes, ..]) => {
                        match self.node(*bytes) {
                            Node::Bytes(range) => Some(self.bytes[range.clone()].into()),
                            _ => None,
                        }
                    }
                    _ => None,
                }
            }
            _ => None,
        }
    }

    pub(super) fn integer(&self, id: Id) -> Option<i64> {
        match self.node(id) {
            Node::Integer(value) => Some(*value),
            _ => None,
        }
    }

    /// Of a list or a tuple.
    pub(super) fn items(&self, id: Id) -> Option<&[Id]> {
        match self.node(id) {
            Node::Sequence(items) => Some(items),
            Node::Object(object) if !object.items.is_empty() => Some(&object.items),
            _ => None,
        }
    }

    /// Of a dictionary, or of an object that is one or keeps its own in one.
    pub(super) fn entries(&self, id: Id) -> Option<&[(Id, Id)]> {
        match self.node(id) {
            Node::Dict(entries) => Some(entries),
            Node::Object(object) if !object.entries.is_empty() => Some(&object.entries),
            Node::Object(object) => match object.state.map(|state| self.node(state)) {
                Some(Node::Dict(entries)) => Some(entries),
                _ => None,
            },
            _ => None,
        }
    }

    /// Module and name of a class or a function.
    pub(super) fn global(&self, id: Id) -> Option<(&'a str, &'a str)> {
        match self.node(id) {
            Node::Global(global) => Some((self.str(&global.module)?, self.str(&global.name)?)),
            _ => None,
        }
    }

    fn str(&self, range: &Range<usize>) -> Option<&'a str> {
        std::str::from_utf8(&self.bytes[range.clone()]).ok()
    }
}

/// Python's stack machine, as far as it makes values.
struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    values_left: usize,
    nodes: Vec<Node>,
    stack: Vec<Id>,
    /// Heights of the stack.
    marks: Vec<usize>,
    memo: BTreeMap<usize, Id>,
}

impl Machine<'_> {
    fn run(&mut self) -> Result<Id, String> {
        loop {
            let at = self.at;
            let code = self.take(1)?.start;
            let code = self.bytes[code];
            match self.step(code) {
                Ok(true) => return self.pop(),
                Ok(false) => {}
                Err(what) => return Err(format!("byte {at}: {what}")),
            }
        }
    }

    /// Whether it was the last.
    fn step(&mut self, code: u8) -> Result<bool, String> {
        match code {
            b'.' => return Ok(true),
            0x80 => self.skip(1)?,
            0x95 => self.skip(8)?,
            b'(' => self.marks.push(self.stack.len()),
            b'0' => drop(self.pop()?),
            b'1' => drop(self.pop_mark()?),
            b'2' => {
                let top = self.top()?;
                self.push_again(top)?;
            }
            b'N' => self.push(Node::Nothing)?,
            0x88 => self.push(Node::Bool(true))?,
            0x89 => self.push(Node::Bool(false))?,
            b'J' => {
                let value = i32::from_le_bytes(self.array()?);
                self.push(Node::Integer(value.into()))?;
            }
            b'K' => self.push_integer(1)?,
            b'M' => self.push_integer(2)?,
            0x8a => self.long(1)?,
            0x8b => self.long(4)?,
            b'G' => {
                let value = f64::from_be_bytes(self.array()?);
                self.push(Node::Number(value))?;
            }
            0x8c => self.span(1, Node::Text)?,
            b'X' => self.span(4, Node::Text)?,
            0x8d => self.span(8, Node::Text)?,
            // What Python 2 calls a text may be bytes: they are read as what they are asked for.
            b'U' | b'C' => self.text_or_bytes(1, code)?,
            b'T' | b'B' => self.text_or_bytes(4, code)?,
            0x8e | 0x96 => self.span(8, Node::Bytes)?,
            b']' | b')' | 0x8f => self.push(Node::Sequence(Vec::new()))?,
            b'}' => self.push(Node::Dict(Vec::new()))?,
            0x85 => self.tuple(1)?,
            0x86 => self.tuple(2)?,
            0x87 => self.tuple(3)?,
            b't' | b'l' | 0x91 => {
                let items = self.pop_mark()?;
                self.push(Node::Sequence(items))?;
            }
            b'd' => {
                let items = self.pop_mark()?;
                self.push(Node::Dict(pairs(&items)?))?;
            }
            b'a' => {
                let item = self.pop()?;
                self.extend(&[item])?;
            }
            b'e' | 0x90 => {
                let items = self.pop_mark()?;
                self.extend(&items)?;
            }
            b's' => {
                let value = self.pop()?;
                let key = self.pop()?;
                self.set(&[key, value])?;
            }
            b'u' => {
                let items = self.pop_mark()?;
                self.set(&items)?;
            }
            b'c' => {
                let module = self.line()?;
                let name = self.line()?;
                self.push(Node::Global(Box::new(Global { module, name })))?;
            }
            0x93 => self.stack_global()?,
            b'R' | 0x81 => {
                let arguments = self.pop()?;
                self.object(arguments)?;
            }
            0x92 => {
                self.pop()?;
                let arguments = self.pop()?;
                self.object(arguments)?;
            }
            b'b' => self.build()?,
            b'Q' => {
                let id = self.pop()?;
                self.push(Node::Elsewhere(id))?;
            }
            b'q' => self.remember(1)?,
            b'r' => self.remember(4)?,
            0x94 => {
                let top = self.top()?;
                self.memo.insert(self.memo.len(), top);
            }
            b'h' => self.recall(1)?,
            b'j' => self.recall(4)?,
            _ => return Err(format!("code {code:#04x} is not read")),
        }
        Ok(false)
    }

    fn take(&mut self, count: usize) -> Result<Range<usize>, String> {
        let end = self
            .at
            .checked_add(count)
            .filter(|end| *end <= self.bytes.len());
        let end = end.ok_or("it ends before its last value")?;
        let range = self.at..end;
        self.at = end;
        Ok(range)
    }

    fn skip(&mut self, count: usize) -> Result<(), String> {
        self.take(count).map(|_| ())
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let range = self.take(N)?;
        let mut array = [0; N];
        array.copy_from_slice(&self.bytes[range]);
        Ok(array)
    }

    /// An integer of so many bytes, without a sign, the lowest first.
    fn unsigned(&mut self, width: usize) -> Result<usize, String> {
        let range = self.take(width)?;
        let bytes = self.bytes[range].iter().rev();
        let value = bytes.fold(0_u64, |value, byte| (value << 8) | u64::from(*byte));
        usize::try_from(value).map_err(|_| "it has a length that no memory has".to_owned())
    }

    /// The text up to the end of its line.
    fn line(&mut self) -> Result<Range<usize>, String> {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|byte| *byte == b'\n');
        let length = length.ok_or("it ends before its last value")?;
        let line = self.take(length)?;
        self.at += 1;
        Ok(line)
    }

    fn push(&mut self, node: Node) -> Result<(), String> {
        self.nodes.push(node);
        self.push_again(self.nodes.len() - 1)
    }

    fn push_again(&mut self, id: Id) -> Result<(), String> {
        self.values_left = self
            .values_left
            .checked_sub(1)
            .ok_or("it holds more values than a log has")?;
        self.stack.push(id);
        Ok(())
    }

    fn push_integer(&mut self, width: usize) -> Result<(), String> {
        let value = self.unsigned(width)? as i64;
        self.push(Node::Integer(value))
    }

    /// An integer with a sign and its own length.
    fn long(&mut self, width: usize) -> Result<(), String> {
        let length = self.unsigned(width)?;
        let range = self.take(length)?;
        let bytes = &self.bytes[range];
        let is_negative = bytes.last().is_some_and(|byte| byte & 0x80 != 0);
        let fill = if is_negative { 0xff } else { 0 };
        let mut all = [fill; 8];
        if bytes.len() > all.len() {
            return self.push(Node::Other);
        }
        all[..bytes.len()].copy_from_slice(bytes);
        self.push(Node::Integer(i64::from_le_bytes(all)))
    }

    /// What lies in the file, behind its length.
    fn span(&mut self, width: usize, node: fn(Range<usize>) -> Node) -> Result<(), String> {
        let length = self.unsigned(width)?;
        let range = self.take(length)?;
        self.push(node(range))
    }

    fn text_or_bytes(&mut self, width: usize, code: u8) -> Result<(), String> {
        let length = self.unsigned(width)?;
        let range = self.take(length)?;
        let is_text = matches!(code, b'U' | b'T') && self.bytes[range.clone()].is_ascii();
        self.push(if is_text {
            Node::Text(range)
        } else {
            Node::Bytes(range)
        })
    }

    /// Nothing below the last mark may be taken.
    fn pop(&mut self) -> Result<Id, String> {
        let floor = self.marks.last().copied().unwrap_or(0);
        match self.stack.pop() {
            Some(id) if self.stack.len() >= floor => Ok(id),
            _ => Err("a value is missing".to_owned()),
        }
    }

    fn top(&self) -> Result<Id, String> {
        let top = self.stack.last().copied();
        top.ok_or_else(|| "a value is missing".to_owned())
    }

    fn pop_mark(&mut self) -> Result<Vec<Id>, String> {
        let mark = self.marks.pop().ok_or("a mark is missing")?;
        Ok(self.stack.split_off(mark.min(self.stack.len())))
    }

    fn tuple(&mut self, count: usize) -> Result<(), String> {
        let mut items = Vec::with_capacity(count);
        for _ in 0..count {
            items.push(self.pop()?);
        }
        items.reverse();
        self.push(Node::Sequence(items))
    }

    fn extend(&mut self, items: &[Id]) -> Result<(), String> {
        let top = self.top()?;
        match &mut self.nodes[top] {
            Node::Sequence(all) => all.extend(items),
            Node::Object(object) => object.items.extend(items),
            _ => return Err("what is appended to is no list".to_owned()),
        }
        Ok(())
    }

    fn set(&mut self, items: &[Id]) -> Result<(), String> {
        let items = pairs(items)?;
        let top = self.top()?;
        match &mut self.nodes[top] {
            Node::Dict(all) => all.extend(items),
            Node::Object(object) => object.entries.extend(items),
            _ => return Err("what a key is set in is no dictionary".to_owned()),
        }
        Ok(())
    }

    fn stack_global(&mut self) -> Result<(), String> {
        let name = self.pop()?;
        let module = self.pop()?;
        match (&self.nodes[module], &self.nodes[name]) {
            (Node::Text(module), Node::Text(name)) => {
                let (module, name) = (module.clone(), name.clone());
                self.push(Node::Global(Box::new(Global { module, name })))
            }
            _ => Err("a class without a name".to_owned()),
        }
    }

    /// The callee is on the stack.
    fn object(&mut self, arguments: Id) -> Result<(), String> {
        let callee = self.pop()?;
        self.push(Node::Object(Box::new(Object {
            callee,
            arguments,
            state: None,
            items: Vec::new(),
            entries: Vec::new(),
        })))
    }

    fn build(&mut self) -> Result<(), String> {
        let state = self.pop()?;
        let top = self.top()?;
        if let Node::Object(object) = &mut self.nodes[top] {
            object.state = Some(state);
        }
        Ok(())
    }

    fn remember(&mut self, width: usize) -> Result<(), String> {
        let key = self.unsigned(width)?;
        let top = self.top()?;
        self.memo.insert(key, top);
        Ok(())
    }

    fn recall(&mut self, width: usize) -> Result<(), String> {
        let key = self.unsigned(width)?;
        let id = self.memo.get(&key).copied();
        self.push_again(id.ok_or("a value is recalled that was not remembered")?)
    }
}

fn pairs(items: &[Id]) -> Result<Vec<(Id, Id)>, String> {
    let (pairs, rest) = items.as_chunks();
    match rest {
        [] => Ok(pairs.iter().map(|[key, value]| (*key, *value)).collect()),
        _ => Err("a key without a value".to_owned()),
    }
}
