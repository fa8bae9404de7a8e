//! The four memories of a controller as words, and as the bytes of a file.
//!
//! An image file, numbers little-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `SMSDPROG` |
//! | 2 | version of the format, 1 |
//! | 2 | 0 |
//! | 4 × 2 | how many instructions each memory has, 0 to 255 |
//! | 4 each | the instructions of memory 0, then of 1, 2, 3 |
//! | 4 | CRC-32 (ISO-HDLC, as in zip) of all bytes before it |

use crate::diagnostic::Place;
use stepdrive_spec::smsd::instructions::{Instruction, PROGRAM_AREAS, PROGRAM_LINES};

const MAGIC: &[u8; 8] = b"SMSDPROG";
const VERSION: u16 = 1;
const HEADER_BYTES: usize = 20;
const CRC_BYTES: usize = 4;

/// The programs of the four memories. Each has at most [`PROGRAM_LINES`] words; they need not be valid instructions.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Image {
    areas: [Vec<u32>; PROGRAM_AREAS],
}

/// Why words or bytes are no image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ImageError {
    /// A memory that a controller does not have.
    #[error("there is no memory {0}: a controller has memories 0 to 3")]
    NoSuchMemory(usize),
    /// More words than a memory holds.
    #[error("memory {memory} would get {words} instructions, and holds 255")]
    TooLong {
        /// Which memory, 0 to 3.
        memory: usize,
        /// How many words it would get.
        words: usize,
    },
    /// The bytes do not begin as an image does.
    #[error("this is no program image: it does not begin with SMSDPROG")]
    NotAnImage,
    /// A format that this version does not read.
    #[error("the image has format {0}, and this program reads format 1")]
    UnknownVersion(u16),
    /// The bytes end early, or go on behind the end.
    #[error("the image has {found} bytes and should have {expected}")]
    WrongLength {
        /// How many bytes it should have, as far as can be told.
        expected: usize,
        /// How many it has.
        found: usize,
    },
    /// A reserved field is not 0.
    #[error("the image is damaged: its reserved bytes are {0:#06X}, not 0")]
    ReservedField(u16),
    /// The checksum is not that of the bytes.
    #[error("the image is damaged: its checksum is {stored:#010X}, and that of its bytes {computed:#010X}")]
    WrongChecksum {
        /// What the file says.
        stored: u32,
        /// What the bytes give.
        computed: u32,
    },
    /// Bare words whose bytes are not a multiple of four.
    #[error("{0} bytes are no sequence of instructions, which have 4 bytes each")]
    HalfWord(usize),
}

impl Image {
    /// Four empty memories.
    pub fn new() -> Image {
        Image::default()
    }

    /// The words of a memory; none for a memory above 3.
    pub fn area(&self, memory: usize) -> &[u32] {
        self.areas.get(memory).map_or(&[], Vec::as_slice)
    }

    /// Puts a program into a memory, in place of what was there.
    ///
    /// # Errors
    /// [`ImageError::NoSuchMemory`] above memory 3, [`ImageError::TooLong`] above 255 words.
    pub fn set_area(&mut self, memory: usize, words: &[u32]) -> Result<(), ImageError> {
        let area = self.areas.get_mut(memory).ok_or(ImageError::NoSuchMemory(memory))?;
        if words.len() > PROGRAM_LINES {
            return Err(ImageError::TooLong { memory, words: words.len() });
        }
        area.clear();
        area.extend_from_slice(words);
        Ok(())
    }

    /// The word at a place; `None` behind the end of its memory.
    pub fn word(&self, place: Place) -> Option<u32> {
        self.area(usize::from(place.memory)).get(usize::from(place.line)).copied()
    }

    /// How many words a memory has, 0 to 255.
    pub fn size(&self, memory: usize) -> u8 {
        u8::try_from(self.area(memory).len()).unwrap_or(u8::MAX)
    }

    /// Every word with its place, memory by memory.
    pub fn words(&self) -> impl Iterator<Item = (Place, u32)> + '_ {
        // The words come first in each pair: of 255 lines the last is taken, and none is counted behind it.
        let line = |memory: u8, (word, line): (&u32, u8)| (Place { memory, line }, *word);
        self.areas
            .iter()
            .zip(0..)
            .flat_map(move |(area, memory)| area.iter().zip(0..).map(move |pair| line(memory, pair)))
    }

    /// The image as the bytes of a file; the module's page has the format.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend([0, 0]);
        bytes.extend((0..PROGRAM_AREAS).flat_map(|memory| u16::from(self.size(memory)).to_le_bytes()));
        bytes.extend(self.words().flat_map(|(_, word)| word.to_le_bytes()));
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes
    }

    /// The image in the bytes of a file.
    ///
    /// # Errors
    /// When the bytes are not exactly what [`Image::to_bytes`] gives for some image.
    pub fn from_bytes(bytes: &[u8]) -> Result<Image, ImageError> {
        let Some(rest) = bytes.strip_prefix(MAGIC) else { return Err(ImageError::NotAnImage) };
        let expected = HEADER_BYTES + CRC_BYTES;
        let short = ImageError::WrongLength { expected, found: bytes.len() };
        let (header, _) = rest.split_first_chunk::<12>().ok_or(short)?;
        let (fields, _) = header.as_chunks::<2>();
        let mut fields = fields.iter().map(|field| u16::from_le_bytes(*field));
        match (fields.next(), fields.next()) {
            (Some(VERSION), Some(0)) => Image::from_sizes(fields.map(usize::from), bytes),
            (Some(VERSION), reserved) => Err(ImageError::ReservedField(reserved.unwrap_or(0))),
            (version, _) => Err(ImageError::UnknownVersion(version.unwrap_or(0))),
        }
    }

    fn from_sizes(sizes: impl Iterator<Item = usize>, bytes: &[u8]) -> Result<Image, ImageError> {
        let sizes: Vec<usize> = sizes.collect();
        if let Some((memory, words)) =
            sizes.iter().copied().enumerate().find(|(_, size)| *size > PROGRAM_LINES)
        {
            return Err(ImageError::TooLong { memory, words });
        }
        let expected = HEADER_BYTES + 4 * sizes.iter().sum::<usize>() + CRC_BYTES;
        let wrong_length = ImageError::WrongLength { expected, found: bytes.len() };
        if bytes.len() != expected {
            return Err(wrong_length);
        }
        let (content, crc) = bytes.split_last_chunk::<CRC_BYTES>().ok_or(wrong_length)?;
        let (stored, computed) = (u32::from_le_bytes(*crc), crc32fast::hash(content));
        if stored != computed {
            return Err(ImageError::WrongChecksum { stored, computed });
        }
        let mut words = words_of(content.get(HEADER_BYTES..).ok_or(wrong_length)?);
        let mut image = Image::new();
        for (area, size) in image.areas.iter_mut().zip(sizes) {
            area.extend(words.by_ref().take(size));
        }
        Ok(image)
    }

    /// An image of bare words: the bytes of one memory, four to an instruction, little-endian, as `MEM_CMD` and the USB
    /// protocol carry them.
    ///
    /// # Errors
    /// [`ImageError::HalfWord`] when the bytes are not a multiple of four, and those of [`Image::set_area`].
    pub fn from_words(memory: usize, bytes: &[u8]) -> Result<Image, ImageError> {
        if !bytes.len().is_multiple_of(4) {
            return Err(ImageError::HalfWord(bytes.len()));
        }
        if bytes.len() / 4 > PROGRAM_LINES {
            return Err(ImageError::TooLong { memory, words: bytes.len() / 4 });
        }
        let mut image = Image::new();
        image.set_area(memory, &words_of(bytes).collect::<Vec<u32>>())?;
        Ok(image)
    }

    /// For reading: a line an instruction, with its place, its word and what it means.
    pub fn listing(&self) -> String {
        let line = |(place, word): (Place, u32)| {
            let meaning = match Instruction::from_word(word) {
                Ok(instruction) => crate::disassemble::bare(instruction),
                Err(error) => format!("; {error}"),
            };
            format!("{:<8} 0x{word:08X}  {meaning}\n", place.to_string())
        };
        self.words().map(line).collect()
    }
}

fn words_of(bytes: &[u8]) -> impl Iterator<Item = u32> + '_ {
    let (words, _) = bytes.as_chunks::<4>();
    words.iter().map(|word| u32::from_le_bytes(*word))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Image {
        let mut image = Image::new();
        image.set_area(0, &[0x0001_9060, 0]).expect("fits");
        image.set_area(3, &[0xFFFF_FFFF]).expect("fits");
        image
    }

    #[test]
    fn an_image_survives_its_file() {
        let bytes = example().to_bytes();
        assert_eq!(bytes.len(), 20 + 12 + 4);
        assert_eq!(bytes.get(20..24), Some(&[0x60, 0x90, 0x01, 0x00][..]));
        assert_eq!(Image::from_bytes(&bytes), Ok(example()));
    }

    #[test]
    fn every_damaged_byte_and_every_cut_is_noticed() {
        let bytes = example().to_bytes();
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 0x10);
            assert!(Image::from_bytes(&damaged).is_err(), "byte {at}");
            assert!(Image::from_bytes(bytes.get(..at).unwrap_or(&[])).is_err(), "cut at {at}");
        }
        assert_eq!(Image::from_bytes(b"ELF"), Err(ImageError::NotAnImage));
        let long = [bytes, vec![0]].concat();
        assert_eq!(Image::from_bytes(&long), Err(ImageError::WrongLength { expected: 36, found: 37 }));
    }

    #[test]
    fn bare_words_fill_the_memory_that_is_named() {
        let image = Image::from_words(2, &[0x60, 0x90, 0x01, 0x00]).expect("one word");
        assert_eq!(image.area(2), [0x0001_9060]);
        assert_eq!(Image::from_words(2, &[1, 2, 3]), Err(ImageError::HalfWord(3)));
        assert_eq!(Image::from_words(4, &[]), Err(ImageError::NoSuchMemory(4)));
        let too_long = ImageError::TooLong { memory: 0, words: 256 };
        assert_eq!(Image::from_words(0, &[0; 1024]), Err(too_long));
    }

    #[test]
    fn the_listing_has_place_word_and_meaning() {
        let expected = "\
mem0:0   0x00019060  SET_MAX_SPEED 100
mem0:1   0x00000000  END
mem3:0   0xFFFFFFFF  ; the reserved bits 3:0 are 0xF, not 0
";
        assert_eq!(example().listing(), expected);
    }
}
