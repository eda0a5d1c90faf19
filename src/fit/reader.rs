//! Serde's data model on TOML values.

use serde::{
    Deserializer,
    de::{
        DeserializeSeed, EnumAccess, Error, IntoDeserializer, MapAccess, SeqAccess, Unexpected,
        VariantAccess, Visitor, value::StringDeserializer,
    },
    forward_to_deserialize_any,
};
use toml::{Table, Value};

use super::{Fault, Mistake, Step, date_in_words};

/// Reads a value by serde's rules.
pub(super) struct Reader(pub(super) Value);

impl<'de> Deserializer<'de> for Reader {
    type Error = Mistake;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        match self.0 {
            Value::String(text) => visitor.visit_string(text),
            Value::Integer(number) => visitor.visit_i64(number),
            Value::Float(number) => visitor.visit_f64(number),
            Value::Boolean(truth) => visitor.visit_bool(truth),
            Value::Datetime(date) => {
                let found = format!("the {} {date}", date_in_words(&date));
                Err(Mistake::invalid_type(Unexpected::Other(&found), &visitor))
            }
            Value::Array(elements) => {
                let most = elements.len();
                let mut elements = Elements(elements.into_iter().enumerate());
                let value = visitor.visit_seq(&mut elements)?;
                match elements.0.len() {
                    0 => Ok(value),
                    beyond => {
                        let expected = format!("{} elements", most - beyond);
                        Err(Mistake::invalid_length(most, &expected.as_str()))
                    }
                }
            }
            Value::Table(table) => visitor.visit_map(Fields::of(table)),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        visitor.visit_newtype_struct(self)
    }

    /// Reads a table by its keys; a list has none.
    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        match self.0 {
            Value::Array(_) => Err(Mistake::invalid_type(Unexpected::Seq, &"a map")),
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        let (name, fields) = match self.0 {
            Value::String(name) => (name, None),
            Value::Table(table) => {
                let mut choices = table.into_iter();
                match (choices.next(), choices.next()) {
                    (Some((name, fields)), None) => (name, Some(fields)),
                    _ => return Err(Mistake::new(Fault::NotOneChoice { known: variants })),
                }
            }
            _ => return Err(Mistake::new(Fault::NoChoice { known: variants })),
        };
        visitor.visit_enum(Choice { name, fields })
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf
        unit unit_struct seq tuple tuple_struct map identifier ignored_any
    }
}

/// The elements of a list that are not yet read, with their indices.
struct Elements(std::iter::Enumerate<std::vec::IntoIter<Value>>);

impl<'de> SeqAccess<'de> for &mut Elements {
    type Error = Mistake;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Mistake> {
        let Some((index, value)) = self.0.next() else {
            return Ok(None);
        };
        seed.deserialize(Reader(value))
            .map(Some)
            .map_err(|mistake| mistake.under(Step::Index(index)))
    }
}

/// The fields of a table that are not yet read.
struct Fields {
    rest: toml::map::IntoIter<String, Value>,
    /// The field whose key was read, and whose value was not.
    current: Option<(String, Value)>,
}

impl Fields {
    fn of(table: Table) -> Self {
        Self {
            rest: table.into_iter(),
            current: None,
        }
    }
}

impl<'de> MapAccess<'de> for Fields {
    type Error = Mistake;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Mistake> {
        let Some((key, value)) = self.rest.next() else {
            return Ok(None);
        };
        let name: StringDeserializer<Mistake> = key.clone().into_deserializer();
        let read = seed
            .deserialize(name)
            .map_err(|mistake| mistake.under(Step::Key(key.clone())))?;
        self.current = Some((key, value));
        Ok(Some(read))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Mistake> {
        let (key, value) = self
            .current
            .take()
            .ok_or_else(|| Mistake::custom("a value was asked for before its key"))?;
        seed.deserialize(Reader(value))
            .map_err(|mistake| mistake.under(Step::Key(key)))
    }
}

/// A choice: a name, and what belongs to it where it is made by a table.
struct Choice {
    name: String,
    fields: Option<Value>,
}

impl Choice {
    /// What belongs to the choice, with its name.
    ///
    /// # Errors
    ///
    /// There is only a name.
    fn taken_apart(self, keys: &'static [&'static str]) -> Result<(Value, String), Mistake> {
        match self.fields {
            Some(fields) => Ok((fields, self.name)),
            None => Err(Mistake::new(Fault::NameAlone {
                name: self.name,
                keys,
            })),
        }
    }
}

impl<'de> EnumAccess<'de> for Choice {
    type Error = Mistake;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), Mistake> {
        let name: StringDeserializer<Mistake> = self.name.clone().into_deserializer();
        let variant = seed.deserialize(name).map_err(|mistake| {
            // The name is a key of the table, or the whole value.
            if self.fields.is_some() {
                mistake.under(Step::Key(self.name.clone()))
            } else {
                mistake
            }
        })?;
        Ok((variant, self))
    }
}

impl<'de> VariantAccess<'de> for Choice {
    type Error = Mistake;

    fn unit_variant(self) -> Result<(), Mistake> {
        match self.fields {
            None => Ok(()),
            Some(Value::Table(fields)) if fields.is_empty() => Ok(()),
            Some(_) => Err(Mistake::new(Fault::NoFields { name: self.name })),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Mistake> {
        let (value, name) = self.taken_apart(&[])?;
        seed.deserialize(Reader(value))
            .map_err(|mistake| mistake.under(Step::Key(name)))
    }

    fn tuple_variant<V: Visitor<'de>>(self, _n: usize, visitor: V) -> Result<V::Value, Mistake> {
        let (value, name) = self.taken_apart(&[])?;
        Reader(value)
            .deserialize_any(visitor)
            .map_err(|mistake| mistake.under(Step::Key(name)))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        let (value, name) = self.taken_apart(fields)?;
        Reader(value)
            .deserialize_struct("", fields, visitor)
            .map_err(|mistake| mistake.under(Step::Key(name)))
    }
}
