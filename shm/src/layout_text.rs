//! The layout of the messages as text for people (`docs/messages.md`) and for C (`docs/freeplay.h`).

use crate::layout::{Codes, Field, JOINTS, Layout, codes, messages};
use crate::messages::{LAYOUT_VERSION, State};

/// Command that regenerates both files.
const MADE_BY: &str = "cargo run -p freeplay-shm --example layout";

/// Returns the text of `docs/messages.md`.
#[must_use]
pub fn markdown() -> String {
    let mut text = format!(
        "<!-- Made by `{MADE_BY}`; a test compares it with the types. -->\n# The messages\n\n\
         Layout version **{LAYOUT_VERSION}**. All messages are C structures of fixed size without padding, in the byte order of the machine. \
         Joint arrays have {JOINTS} entries; the first n are used, in the order of the arm file from base to tool, the rest are zero. \
         Units are SI; those in brackets are for prismatic joints. `freeplay.h` beside this file holds the same for C and C++, \
         [`python/freeplay/controller.py`](../python/freeplay/controller.py) for Python.\n\n{PROTOCOL}"
    );
    for layout in messages() {
        push_table(&mut text, &layout);
    }
    text.push_str("\n## Codes\n");
    for group in codes() {
        push_codes(&mut text, &group);
    }
    push(
        &mut text,
        format_args!(
            "\nBits {} to {} of `State.flags` hold the slot whose command is in force during this tick, bits {} to {} the slot whose \
             answer to this state is to be put in force: another one where a swap is planned.",
            State::IN_CHARGE_SHIFT,
            State::IN_CHARGE_SHIFT + 3,
            State::NEXT_SHIFT,
            State::NEXT_SHIFT + 3
        ),
    );
    text
}

/// Description of the protocol: who sends which message, and in which order.
const PROTOCOL: &str = "\
## How it goes

The transport is iceoryx2 0.10.0 (crate, PyPI package, C and C++ bindings of the same version), each run with a root path, a prefix and
services of its own. `FREEPLAY_RUN` holds the address of the run: the path of its folder on tmpfs, whose last part is the run's id.
`FREEPLAY_SLOT` holds the slot to take, 0 if it is not set. A controller

1. takes a shared `flock` on the run's folder and keeps it;
2. makes an iceoryx2 node with the folder as root path and the prefix `freeplay-<id>_`, without signal handling and with the clean-up of
   dead nodes switched off; whoever makes a service fixes its settings, so it only opens what is there;
3. takes the exclusive `flock` on `slot-<slot>.lock` in the folder: the seat, which the kernel frees however the process ends;
4. opens `freeplay/command/<slot>` to publish and `freeplay/state` to subscribe;
5. says `Hello` with `claim` 1 on `freeplay/hello` and hears `Welcome`; a verdict other than 0 ends it, and so does a wait of seconds.
   Seat, hello and commands are of one process: by the ids of iceoryx2 the plant knows whom a message is from, and it takes the commands
   of a slot from the process alone that holds its seat and was welcomed;
6. reads the task file that the welcome names, gets ready, and answers states until one has the flag `last`.

| service | pattern | payload, and its type name |
| --- | --- | --- |
| `freeplay/state` | publish-subscribe | State, `freeplay.State` |
| `freeplay/command/<slot>` | publish-subscribe | Command, `freeplay.Command` |
| `freeplay/hello` | request-response | Hello, `freeplay.Hello`; Welcome, `freeplay.Welcome` |

In lockstep every state is answered, in order. In real time the newest counts. The answer to the state of tick k is judged by the plant's
gate (magic, layout, run, slot, joints, kind, status, tick; finite, in range, rate) and put in force during tick k + 1. What the gate refuses is counted
by name and never applied. No side ever waits for a full buffer: the oldest message is lost.

## Versions

`layout` rises whenever an offset, a size or a meaning in State or Command changes. Plant and controller of different versions refuse
each other in words. Hello and Welcome never change.
";

fn push(text: &mut String, line: std::fmt::Arguments<'_>) {
    text.push_str(&line.to_string());
    text.push('\n');
}

fn push_table(text: &mut String, layout: &Layout) {
    let frozen = if layout.frozen { " Frozen for all time." } else { "" };
    push(text, format_args!("\n## {}\n\n{} {} bytes.{frozen}\n", layout.name, layout.meaning, layout.size));
    push(text, format_args!("| field | type | offset | size | symbol | frame | unit | meaning |"));
    push(text, format_args!("| --- | --- | ---: | ---: | --- | --- | --- | --- |"));
    for field in &layout.fields {
        let Field { name, offset, size, symbol, frame, unit, meaning, .. } = field;
        let form = form(field);
        push(
            text,
            format_args!(
                "| `{name}` | {form} | {offset} | {size} | {symbol} | {frame} | {unit} | {meaning} |"
            ),
        );
    }
}

fn push_codes(text: &mut String, group: &Codes) {
    push(text, format_args!("\n### {}: {}\n", group.name, group.fields));
    push(text, format_args!("| name | number | meaning |\n| --- | ---: | --- |"));
    for (name, code, meaning) in &group.codes {
        push(text, format_args!("| `{name}` | {code} | {meaning} |"));
    }
}

/// The type of a field, as text for the tables.
fn form(field: &Field) -> String {
    let element = match field.c_type {
        "uint32_t" => "u32",
        "uint64_t" => "u64",
        "uint8_t" => "u8",
        "double" => "f64",
        _ => "Reference",
    };
    if field.count == 0 { element.to_owned() } else { format!("{element}[{}]", field.count) }
}

/// Returns the text of `docs/freeplay.h`.
#[must_use]
pub fn c_header() -> String {
    let mut text = format!(
        "/* The messages of Freeplay, layout version {LAYOUT_VERSION}; messages.md beside this file says what they mean.\n   Made by `{MADE_BY}`. */\n\
         #ifndef FREEPLAY_H\n#define FREEPLAY_H\n\n#include <assert.h>\n#include <stddef.h>\n#include <stdint.h>\n\n\
         #define FREEPLAY_LAYOUT_VERSION {LAYOUT_VERSION}u\n#define FREEPLAY_MAX_JOINTS {JOINTS}\n\
         #define FREEPLAY_MAGIC \"FREEPLAY\" /* the eight bytes of the field magic */\n\
         #define FREEPLAY_IN_CHARGE_SHIFT {}\n#define FREEPLAY_NEXT_SHIFT {}\n#define FREEPLAY_SLOT_MASK 0xfu\n",
        State::IN_CHARGE_SHIFT,
        State::NEXT_SHIFT
    );
    for group in codes() {
        push(&mut text, format_args!("\n/* {} */\nenum {{", group.fields));
        for (name, code, _) in &group.codes {
            let name = format!("FREEPLAY_{}_{}", snake(group.name), name).to_uppercase();
            push(&mut text, format_args!("    {name} = {code},"));
        }
        text.push_str("};\n");
    }
    text.push_str("\n/* iceoryx2 knows these types by the names freeplay.State, freeplay.Command, freeplay.Hello, freeplay.Welcome. */\n");
    for layout in messages() {
        push_struct(&mut text, &layout);
    }
    text.push_str("\n#endif\n");
    text
}

fn push_struct(text: &mut String, layout: &Layout) {
    push(text, format_args!("\n/* {} */\ntypedef struct {{", layout.meaning));
    for field in &layout.fields {
        let count = if field.count == 0 { String::new() } else { format!("[{}]", field.count) };
        let unit = if field.unit.is_empty() { String::new() } else { format!(" [{}]", field.unit) };
        push(text, format_args!("    {} {}{count}; /* {}{unit} */", field.c_type, field.name, field.meaning));
    }
    let name = format!("freeplay_{}", snake(layout.name));
    push(text, format_args!("}} {name};"));
    push(text, format_args!("static_assert(sizeof({name}) == {}, \"size of {name}\");", layout.size));
    for field in &layout.fields {
        push(
            text,
            format_args!(
                "static_assert(offsetof({name}, {0}) == {1}, \"offset of {name}.{0}\");",
                field.name, field.offset
            ),
        );
    }
}

/// Converts `CommandStatus` to `command_status`.
fn snake(name: &str) -> String {
    let mut text = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.push(letter.to_ascii_lowercase());
    }
    text
}
